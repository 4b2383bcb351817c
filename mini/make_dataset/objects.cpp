#include "objects.h"

#include <algorithm>

#include "bake.h"
#include "lights.h"
#include "mini_data/draw.h"
#include "patina/asset/asset.h"
#include "shapes.h"

namespace patina::make_dataset {
namespace {

namespace fs = std::filesystem;
using mini_data::Draw;

struct KnownAsset {
  std::string path;
  std::vector<std::string> words;
  bool held_out;
};

// CC0 or public domain by their README. The water bottle, the toy car and the shoe stay out altogether:
// results are judged on them.
const std::vector<KnownAsset>& known_assets() {
  static const std::vector<KnownAsset> all{
      {"Spot/spot_triangulated.obj", {"cow", "animal figure", "toy"}, false},
      {"KayKitDungeon/barrel_large_decorated.gltf.glb", {"barrel"}, false},
      {"KayKitDungeon/table_long_decorated_A.gltf.glb", {"table"}, false},
      {"KayKitDungeon/wall_cracked.gltf.glb", {"wall", "ruin"}, false},
      {"KenneyPlatformer/character.glb", {"figure", "toy", "character"}, false},
      {"KayKitDungeon/chest.glb", {"chest"}, true},
  };
  return all;
}

Mesh mesh_of(const asset::Asset& asset) {
  Mesh out;
  for (const asset::Primitive& primitive : asset.primitives)
    append(out, Mesh{primitive.p_world, primitive.triangles});
  return out;
}

}  // namespace

std::vector<ObjectPlan> object_plans(int count) {
  std::vector<ObjectPlan> out;
  const auto& kinds = shape_kinds();
  const auto& assets = known_assets();
  // Assets take the places of a few kinds, one in the first round and three in later ones.
  const auto is_asset_place = [&](size_t kind, uint64_t i) {
    return kind == kinds.size() / 2 || (i >= kinds.size() && (kind == 10 || kind == 24));
  };
  size_t kind = 0, asset = 0;
  for (uint64_t i = 0; static_cast<int>(out.size()) < count; ++i) {
    ObjectPlan plan;
    plan.seed = i + 1;
    if (is_asset_place(kind, i) && asset < assets.size()) {
      plan.kind = assets[asset].path;
      plan.words = assets[asset].words;
      plan.held_out = assets[asset].held_out;
      plan.name = "asset_" + std::to_string(asset);
      ++asset;
      ++kind;
      out.push_back(plan);
      continue;
    }
    const size_t round = i / kinds.size();
    plan.kind = kinds[kind % kinds.size()];
    // A few kinds are never trained on.
    plan.held_out = plan.kind == "anvil" || plan.kind == "goblet" || (i % 11 == 7 && round > 0);
    plan.name = plan.kind + "_" + std::to_string(i);
    kind = (kind + 1) % kinds.size();
    out.push_back(plan);
  }
  return out;
}

void bake_objects(const std::vector<ObjectPlan>& plans, const fs::path& shared, const fs::path& folder,
                  bool quick, const Progress& progress) {
  const auto total = static_cast<double>(plans.size());
  for (size_t i = 0; i < plans.size(); ++i) {
    const ObjectPlan& plan = plans[i];
    progress.throw_if_stopped();
    progress.update("objects", static_cast<double>(i), total);
    const fs::path path = folder / (plan.name + ".shard");
    if (fs::exists(path)) continue;

    Mesh mesh;
    std::vector<std::string> words = plan.words;
    if (!words.empty()) {
      const fs::path file = shared / "assets" / plan.kind;
      if (shared.empty() || !fs::exists(file)) {
        progress.warn(plan.name + ": " + file.string() + " is not there, left out");
        continue;
      }
      mesh = mesh_of(asset::read_asset(file));
    } else {
      Shape shape = make_shape(plan.kind, plan.seed);
      mesh = std::move(shape.mesh);
      words = std::move(shape.words);
    }

    Draw draw(plan.seed, mini_data::kDrawView);
    BakeOptions options;
    options.seed = plan.seed << 8;
    if (quick) options.diffuse_strata /= 2, options.gloss_strata /= 2;
    // The product's own elevation and field of view are the most usual, others are not rare.
    options.elevation = glm::radians(draw.chance(0.3f) ? 20.0f : draw(-10, 50));
    options.azimuth_start = draw(0, 2 * kPi);
    options.fov_y = glm::radians(draw.chance(0.5f) ? 35.0f : draw(25, 50));
    const Light light =
        make_light(plan.seed, shared.empty() ? fs::path() : shared / "assets" / "hdri", plan.held_out);
    BakedObject baked = bake(finished(mesh), light.environment, options, progress);
    baked.object.name = plan.name;
    baked.object.words = words;
    baked.object.environment = light.name;
    baked.object.held_out = plan.held_out || light.held_out;
    mini_data::write_shard(path, entries_of(baked));
  }
  progress.update("objects", total, total);
}

}  // namespace patina::make_dataset
