// The small inputs of tests/data/cases, made after problems that users of other tools reported: each does
// what its row of the README there says must happen.
#include <functional>
#include <set>

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "patina/asset/export.h"
#include "patina/asset/material_maps.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "support.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;

fs::path cases() {
  return test::data_dir() / "cases";
}

size_t num_triangles(const Asset& asset) {
  size_t sum = 0;
  for (const Primitive& p : asset.primitives) sum += p.triangles.size();
  return sum;
}

bool warns_of(const Asset& asset, const std::string& text) {
  for (const std::string& warning : asset.warnings)
    if (warning.find(text) != std::string::npos) return true;
  return false;
}

const Material& named(const Asset& asset, const std::string& name) {
  for (const Material& m : asset.materials)
    if (m.name == name) return m;
  throw std::runtime_error("no material " + name);
}

size_t index_of_material(const Asset& asset, const std::string& name) {
  return static_cast<size_t>(&named(asset, name) - asset.materials.data());
}

// Mean of the base colour picture, as stored.
vec3 mean_picture(const Asset& asset, const Material& m) {
  if (!m.base_color) return vec3(-1.0f);
  const Image& image = asset.images[static_cast<size_t>(m.base_color.image)];
  vec3 sum(0.0f);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) sum += image.rgb(x, y);
  return sum / static_cast<float>(image.num_pixels());
}

// Exports with a green base colour for one material.
void export_green(const Asset& asset, const std::string& material, const fs::path& path) {
  auto maps = resolve_materials(asset);
  std::vector<MapSet> changed(maps.size());
  const size_t m = index_of_material(asset, material);
  maps[m].base_color.texels = Image(4, 4, 3);
  for (int i = 0; i < 16; ++i) maps[m].base_color.texels.set_rgb(i % 4, i / 4, vec3(0, 1, 0));
  changed[m].set(index_of(MapSlot::kBaseColor));
  export_asset(asset, maps, changed, path);
}

nlohmann::json json_of_glb(const fs::path& path) {
  const auto bytes = read_file(path);
  const size_t length = bytes[12] | size_t{bytes[13]} << 8 | size_t{bytes[14]} << 16;
  return nlohmann::json::parse(bytes.begin() + 20, bytes.begin() + 20 + static_cast<std::ptrdiff_t>(length));
}

void expect_textured_box(const Asset& asset) {
  EXPECT_EQ(num_triangles(asset), 12u);
  EXPECT_NO_THROW(require_enhanceable(asset));
  const vec3 size = bounds(asset).max - bounds(asset).min;
  EXPECT_LT(glm::length(size - vec3(1.0f)), 1e-5f);
  EXPECT_TRUE(asset.materials[static_cast<size_t>(asset.primitives[0].material)].base_color);
}

struct Case {
  const char* file;
  std::function<void(const Asset&, const fs::path& scratch)> must;
};

const std::vector<Case>& all_cases() {
  static const std::vector<Case> kCases = {
      {"gltf/hidden_node_required.glb",
       [](const Asset& asset, const fs::path&) {
         ASSERT_EQ(asset.primitives.size(), 1u);
         EXPECT_EQ(asset.primitives[0].name, "kettle");
       }},
      {"gltf/instanced_bricks.glb",
       [](const Asset& asset, const fs::path&) {
         EXPECT_EQ(asset.primitives.size(), 4u);
         EXPECT_EQ(num_triangles(asset), 48u);
       }},
      {"gltf/webp_fallback/box.gltf",
       [](const Asset& asset, const fs::path& scratch) {
         export_green(asset, "paint", scratch / "out.glb");
         const auto json = json_of_glb(scratch / "out.glb");
         EXPECT_EQ(json["images"][0]["mimeType"], "image/png");
         EXPECT_EQ(json["images"][1]["mimeType"], "image/webp");
       }},
      {"gltf/unused_image_missing/box.gltf",
       [](const Asset& asset, const fs::path& scratch) {
         const ExportPlan plan = plan_export(asset, scratch / "out.glb");
         ASSERT_EQ(plan.notes.size(), 1u);
         EXPECT_NE(plan.notes[0].find("lightmap_old.png"), std::string::npos);
         export_green(asset, "paint", scratch / "out.glb");
         EXPECT_EQ(json_of_glb(scratch / "out.glb")["images"][1]["uri"], "lightmap_old.png");
         EXPECT_EQ(num_triangles(read_asset(scratch / "out.glb")), 12u);
       }},
      {"gltf/unused_material_missing/box.gltf",
       [](const Asset& asset, const fs::path& scratch) {
         EXPECT_TRUE(warns_of(asset, "does not exist"));
         export_green(asset, "paint", scratch / "out.glb");
         EXPECT_EQ(num_triangles(read_asset(scratch / "out.glb")), 12u);
       }},
      {"gltf/base_colour_on_uv1.glb",
       [](const Asset& asset, const fs::path&) {
         const UvState uv = uv_states(asset)[0];
         EXPECT_EQ(uv.uv_set, 1);
         EXPECT_FALSE(uv.missing);
         EXPECT_LT(uv.zero_area, 0.01f);
         const auto maps = resolve_materials(asset);
         EXPECT_EQ(maps[0].base_color.uv_set, 1);
         EXPECT_EQ(maps[0].roughness.uv_set, 1);
         EXPECT_EQ(maps[0].normal.uv_set, 1);
       }},
      {"gltf/far_from_origin.glb",
       [](const Asset& asset, const fs::path&) {
         const Bounds box = bounds(asset);
         EXPECT_LT(glm::length(box.max - box.min - vec3(0.2f)), 1e-6f);
         EXPECT_LT(glm::length(box.center()), 1e-6f);
         EXPECT_LT(glm::length(asset.origin - glm::dvec3(408201.5848, 12.5, 4080928.0166)), 1e-6);
       }},
      {"gltf/one_primitive_without_uv.glb",
       [](const Asset& asset, const fs::path&) {
         const UvState uv = uv_states(asset)[0];
         EXPECT_FALSE(uv.missing);
         EXPECT_EQ(uv.parts_without, 1);
         EXPECT_LT(uv.zero_area, 0.01f);
       }},
      {"gltf/matrix_last_row_rounded.glb",
       [](const Asset& asset, const fs::path&) { expect_textured_box(asset); }},
      {"obj/quoted_names/box.obj",
       [](const Asset& asset, const fs::path&) {
         expect_textured_box(asset);
         EXPECT_TRUE(asset.warnings.empty());
       }},
      {"obj/tr_one_is_opaque/box.obj",
       [](const Asset& asset, const fs::path&) {
         expect_textured_box(asset);
         EXPECT_EQ(named(asset, "material0").alpha_mode, AlphaMode::kOpaque);
         EXPECT_TRUE(warns_of(asset, "opaque"));
       }},
      {"obj/hash_in_names/box.obj",
       [](const Asset& asset, const fs::path& scratch) {
         EXPECT_GT(mean_picture(asset, named(asset, "Material #25")).r, 0.5f);
         EXPECT_GT(mean_picture(asset, named(asset, "Material #26")).b, 0.5f);
         EXPECT_EQ(asset.primitives.size(), 2u);
         export_green(asset, "Material #26", scratch / "out.obj");
         const Asset again = read_asset(scratch / "out.obj");
         EXPECT_GT(mean_picture(again, named(again, "Material #25")).r, 0.5f);
         EXPECT_GT(mean_picture(again, named(again, "Material #26")).g, 0.5f);
       }},
      {"obj/empty_entries/box.obj", [](const Asset& asset, const fs::path&) { expect_textured_box(asset); }},
      {"obj/latin1_names/box.obj",
       [](const Asset& asset, const fs::path& scratch) {
         expect_textured_box(asset);
         const std::string name = "W\xC3\xA4nde";
         export_green(asset, name, scratch / "out.glb");
         EXPECT_EQ(json_of_glb(scratch / "out.glb")["materials"][0]["name"], name);
         export_green(asset, name, scratch / "out.obj");
         EXPECT_NE(read_text_file(scratch / "out.obj").find("usemtl W\xE4nde"), std::string::npos);
         const Asset again = read_asset(scratch / "out.obj");
         EXPECT_GT(mean_picture(again, named(again, name)).g, 0.9f);
       }},
      {"obj/library_in_folder/box.obj",
       [](const Asset& asset, const fs::path& scratch) {
         export_green(asset, "paint", scratch / "out" / "box.obj");
         const Asset again = read_asset(scratch / "out" / "box.obj");
         EXPECT_GT(mean_picture(again, named(again, "paint")).g, 0.9f);
         EXPECT_EQ(mean_picture(again, named(again, "metal")), mean_picture(asset, named(asset, "metal")));
         EXPECT_TRUE(again.warnings.empty());
       }},
      {"obj/normals_named_but_missing/box.obj",
       [](const Asset& asset, const fs::path&) {
         expect_textured_box(asset);
         EXPECT_TRUE(warns_of(asset, "normals"));
         for (const vec3& n : asset.primitives[0].n_world) EXPECT_NEAR(glm::length(n), 1.0f, 1e-5f);
       }},
      {"obj/usemtl_before_mtllib/box.obj",
       [](const Asset& asset, const fs::path&) {
         expect_textured_box(asset);
         EXPECT_TRUE(asset.warnings.empty());
       }},
      {"obj/cr_line_ends/box.obj",
       [](const Asset& asset, const fs::path& scratch) {
         expect_textured_box(asset);
         export_green(asset, "paint", scratch / "out.obj");
         const Asset again = read_asset(scratch / "out.obj");
         expect_textured_box(again);
         EXPECT_GT(mean_picture(again, named(again, "paint")).g, 0.9f);
       }},
      {"obj/imfchan/box.obj",
       [](const Asset& asset, const fs::path&) {
         const auto maps = resolve_materials(asset);
         EXPECT_NEAR(maps[0].roughness.texels.pixels[0], 50.0f / 255.0f, 1e-4f);
         EXPECT_NEAR(maps[0].metallic.texels.pixels[0], 230.0f / 255.0f, 1e-4f);
       }},
      {"obj/vertex_colours_rgba/box.obj",
       [](const Asset& asset, const fs::path&) {
         for (const vec4& c : asset.primitives[0].color)
           EXPECT_LT(glm::length(c - vec4(0.8f, 0.1f, 0.1f, 1.0f)), 1e-5f);
       }},
      {"obj/ke_above_one/box.obj",
       [](const Asset& asset, const fs::path& scratch) {
         export_green(asset, "paint", scratch / "out.glb");
         const auto json = json_of_glb(scratch / "out.glb");
         EXPECT_EQ(json["materials"][0]["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"],
                   5.0);
         EXPECT_EQ(json["extensionsUsed"], nlohmann::json({"KHR_materials_emissive_strength"}));
         EXPECT_EQ(read_asset(scratch / "out.glb").materials[0].emissive_factor, vec3(5, 4, 3));
       }},
      {"obj/absolute_path/box.obj",
       [](const Asset& asset, const fs::path& scratch) {
         expect_textured_box(asset);
         EXPECT_TRUE(warns_of(asset, "is taken from 'wood.png'"));
         // The output names the file where it is.
         auto maps = resolve_materials(asset);
         std::vector<MapSet> changed(maps.size());
         changed[0].set(index_of(MapSlot::kRoughness));
         export_asset(asset, maps, changed, scratch / "out.obj");
         EXPECT_NE(read_text_file(scratch / "out.patina.mtl").find("map_Kd wood.png\n"), std::string::npos);
       }},
      {"obj/plain/box.obj",
       [](const Asset& asset, const fs::path& scratch) {
         expect_textured_box(asset);
         EXPECT_TRUE(asset.warnings.empty());
         EXPECT_THROW(plan_export(asset, scratch / "out.gltf"), Error);
         EXPECT_EQ(plan_export(asset, scratch / "out.glb").kind, OutputKind::kGlb);
       }},
  };
  return kCases;
}

TEST(Cases, each_does_what_it_must) {
  for (const Case& c : all_cases()) {
    SCOPED_TRACE(c.file);
    const test::TemporaryFolder scratch;
    try {
      c.must(read_asset(cases() / c.file), scratch.path());
    } catch (const std::exception& e) {
      ADD_FAILURE() << e.what();
    }
  }
}

TEST(Cases, none_is_left_out) {
  std::set<std::string> tested;
  for (const Case& c : all_cases()) {
    const fs::path file(c.file);
    tested.insert((file.parent_path().has_parent_path() ? file.parent_path() : file).string());
  }
  for (const char* kind : {"gltf", "obj"})
    for (const auto& entry : fs::directory_iterator(cases() / kind))
      EXPECT_TRUE(tested.contains(entry.path().lexically_relative(cases()).string())) << entry.path();
}

}  // namespace
}  // namespace patina::asset
