#include "export_scene.h"

#include <span>

#include <nlohmann/json.hpp>

#include "patina/base/files.h"

namespace patina::bench {
namespace {

template <class T>
void write_array(const std::filesystem::path& path, const std::vector<T>& values) {
  write_file(path, std::string_view(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)));
}

}  // namespace

void export_scene(const test::Recovery& r, int min_views, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  std::vector<vec3> p, n;
  std::vector<vec2> uv;
  std::vector<uvec3> triangles;
  for (const asset::Primitive& primitive : r.asset.primitives) {
    if (primitive.material != 0) continue;
    const auto first = static_cast<uint32_t>(p.size());
    p.insert(p.end(), primitive.p_world.begin(), primitive.p_world.end());
    n.insert(n.end(), primitive.n_world.begin(), primitive.n_world.end());
    uv.insert(uv.end(), primitive.uv[0].begin(), primitive.uv[0].end());
    for (const uvec3& t : primitive.triangles) triangles.push_back(t + first);
  }
  write_array(folder / "p.f32", p);
  write_array(folder / "n.f32", n);
  write_array(folder / "uv.f32", uv);
  write_array(folder / "triangles.u32", triangles);
  const Image environment = render::studio_environment().map();
  write_array(folder / "environment.f32", environment.pixels);
  const asset::MaterialMaps& truth = r.truth[0];
  write_array(folder / "base_color.f32", truth.base_color.texels.pixels);
  write_array(folder / "roughness.f32", truth.roughness.texels.pixels);
  write_array(folder / "metallic.f32", truth.metallic.texels.pixels);
  std::vector<float> counted(r.num_views[0].pixels.size());
  for (size_t i = 0; i < counted.size(); ++i) counted[i] = test::counts(r, 0, i, min_views) ? 1.0f : 0.0f;
  write_array(folder / "counted.f32", counted);

  using nlohmann::json;
  json cameras = json::array();
  for (const views::View& view : r.views.views) {
    json matrix = json::array();  // rows
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column) matrix.push_back(view.camera.world_from_camera[column][row]);
    cameras.push_back({{"world_from_camera", matrix}, {"fov_y", view.camera.fov_y}});
  }
  const auto size = [](const Image& image) { return json{image.height, image.width}; };
  const json scene{{"cameras", cameras},
                   {"resolution", r.views.views[0].camera.width},
                   {"exposure_ev", r.views.exposure_ev},
                   {"environment", size(environment)},
                   {"base_color", size(truth.base_color.texels)},
                   {"roughness", size(truth.roughness.texels)},
                   {"metallic", size(truth.metallic.texels)}};
  write_file(folder / "scene.json", scene.dump(1) + "\n");
}

}  // namespace patina::bench
