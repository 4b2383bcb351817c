#include "worlds.h"

#include <algorithm>

#include "patina/base/random.h"
#include "patina/image/color.h"
#include "patina/inverse/seen_points.h"
#include "patina/render/path_tracer.h"

namespace patina::test {
namespace {

asset::Primitive square_of(const std::string& name, int material, const vec3& corner, const vec3& u,
                           const vec3& v) {
  asset::Primitive p;
  p.name = name;
  p.material = material;
  const vec3 n = glm::normalize(glm::cross(u, v));
  for (const vec2 st : {vec2(0, 0), vec2(1, 0), vec2(1, 1), vec2(0, 1)}) {
    p.p_world.push_back(corner + st.x * u + st.y * v);
    p.n_world.push_back(n);
    p.tangent_world.emplace_back(glm::normalize(u), 1.0f);
  }
  p.uv = {{{0.05f, 0.05f}, {0.95f, 0.05f}, {0.95f, 0.95f}, {0.05f, 0.95f}}};
  p.triangles = {{0, 1, 2}, {0, 2, 3}};
  return p;
}

// Random texels between low and high, the same for every run.
asset::Map random_map(int size, int channels, float low, float high, uint64_t index) {
  asset::Map map;
  map.texels = Image(size, size, channels);
  RandomStream random(7, RandomPurpose::kTest, index);
  for (float& value : map.texels.pixels) value = low + (high - low) * random.uniform();
  return map;
}

asset::MaterialMaps random_material(int size, uint64_t index) {
  asset::MaterialMaps maps;
  maps.base_color = random_map(size, 3, 0.2f, 0.8f, 10 * index);
  maps.roughness = random_map(size, 1, 0.35f, 0.7f, 10 * index + 1);
  maps.metallic = random_map(size, 1, 0.2f, 0.6f, 10 * index + 2);
  maps.normal = random_map(size, 3, -0.15f, 0.15f, 10 * index + 3);
  for (size_t i = 2; i < maps.normal.texels.pixels.size(); i += 3) maps.normal.texels.pixels[i] = 1.0f;
  for (size_t i = 0; i < maps.normal.texels.pixels.size(); i += 3) {
    float* n = maps.normal.texels.pixels.data() + i;
    const vec3 unit = glm::normalize(vec3(n[0], n[1], n[2]));
    n[0] = unit.x, n[1] = unit.y, n[2] = unit.z;
  }
  maps.alpha.texels = Image(1, 1, 1, 1.0f);
  maps.emission.texels = Image(1, 1, 3, 0.0f);
  return maps;
}

}  // namespace

const char* name_of(Lighting lighting) {
  switch (lighting) {
    case Lighting::kConstant:
      return "constant environment";
    case Lighting::kStudio:
      return "studio environment";
    case Lighting::kPoint:
      return "point light";
    case Lighting::kEmitter:
      break;
  }
  return "emitter";
}

World make_world(Lighting lighting, int texture_size, int resolution, render::BsdfModel model) {
  auto asset = std::make_unique<asset::Asset>();
  asset->primitives = {square_of("floor", 0, {-1, 0, 1}, {2, 0, 0}, {0, 0, -2}),
                       square_of("wall", 1, {-1, 0, -1}, {2, 0, 0}, {0, 2, 0})};
  std::vector<asset::MaterialMaps> maps = {random_material(texture_size, 1),
                                           random_material(texture_size, 2)};
  render::Environment environment = render::constant_environment(vec3(0.0f));
  switch (lighting) {
    case Lighting::kConstant:
      environment = render::constant_environment({0.8f, 1.0f, 1.2f});
      break;
    case Lighting::kStudio:
      environment = render::studio_environment();
      break;
    case Lighting::kPoint: {
      asset::Light light;
      light.p_world = {0.5f, 1.5f, 0.6f};
      light.intensity = 4.0f;
      asset->lights.push_back(light);
      break;
    }
    case Lighting::kEmitter:
      asset->primitives.push_back(square_of("lamp", 2, {-0.4f, 1.8f, 0.2f}, {0.8f, 0, 0}, {0, 0, 0.6f}));
      maps.push_back(random_material(1, 3));
      maps.back().emission.texels = Image(1, 1, 3, 5.0f);
      break;
  }
  asset->materials.resize(maps.size());
  render::Scene::Options options;
  options.bsdf_model = model;
  render::Scene scene(*asset, maps, std::move(environment), nullptr, options);
  return {std::move(asset), std::move(maps), std::move(scene),
          render::look_at({0.6f, 1.4f, 3.0f}, {0.0f, 0.5f, 0.0f}, 0.7f, resolution, resolution)};
}

views::ViewSet view_of(const World& world) {
  views::ViewSet views;
  views.grid = 1;
  views.views.resize(1);
  views.views[0].camera = world.camera;
  views.views[0].gbuffer = views::make_gbuffer(world.scene, world.camera);
  return views;
}

std::vector<inverse::CachePixel> all_pixels(const views::ViewSet& views) {
  const views::GBuffer& g = views.views[0].gbuffer;
  std::vector<inverse::CachePixel> pixels;
  for (int y = 0; y < g.height; ++y)
    for (int x = 0; x < g.width; ++x) {
      // At a silhouette the cache shows the surface alone, a render also what is beside it.
      bool is_inside = true;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const int nx = x + dx, ny = y + dy;
          const bool is_in_image = nx >= 0 && ny >= 0 && nx < g.width && ny < g.height;
          const int material = is_in_image ? g.material[static_cast<size_t>(ny * g.width + nx)] : -1;
          is_inside = is_inside && (material == 0 || material == 1);
        }
      if (is_inside)
        pixels.push_back({0, static_cast<uint16_t>(x), static_cast<uint16_t>(y), 1.0f, vec3(0.0f)});
    }
  return pixels;
}

inverse::LightCache traced_cache(const World& world, const views::ViewSet& views,
                                 const inverse::CacheOptions& options) {
  inverse::LightCache cache;
  cache.pixels = all_pixels(views);
  std::vector<inverse::SeenPoint> points = inverse::trace_seen_points(world.scene, views, cache.pixels);
  inverse::make_samples(cache, world.scene, world.maps, points);
  inverse::trace_light(cache, world.scene, world.scene.asset_materials(), views, options, {});
  return cache;
}

Task make_task(int resolution, const std::function<void(asset::Map&)>& lay) {
  Task task{make_world(Lighting::kConstant, 8, resolution), {}, {}};
  for (auto& maps : task.world.maps)
    for (asset::Map* map : {&maps.base_color, &maps.roughness, &maps.metallic, &maps.normal}) lay(*map);
  task.world.scene.set_asset_materials(task.world.maps);
  task.views = view_of(task.world);
  render::PathOptions path;
  path.samples_per_pixel = 64;
  task.edited.push_back(tone_map(render::render(task.world.scene, task.world.camera, path).radiance, 0.0f));
  auto flat = task.world.maps;
  for (auto& maps : flat) {
    maps.base_color.texels = Image(8, 8, 3, 0.5f);
    maps.roughness.texels = Image(1, 1, 1, 0.5f);
  }
  task.world.scene.set_asset_materials(flat);
  return task;
}
inverse::FitOptions quick() {
  inverse::FitOptions options;
  options.iterations = 12;
  options.light_samples = 16;
  options.max_depth = 2;
  return options;
}

}  // namespace patina::test
