// Renders one view of an asset to an EXR (linear) or PNG (sRGB) file, and says how fast: samples a second, rays a second, and
// how that compares with casting the same camera rays and nothing else.
// bench/compare_cycles.py renders the same view with Blender's Cycles.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/image/color.h"
#include "patina/image/image_io.h"
#include "patina/render/path_tracer.h"

namespace {

using namespace patina;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Camera rays a second that `scene` answers when nothing is shaded.
double camera_rays_per_second(const render::Scene& scene, const render::Camera& camera) {
  const auto start = std::chrono::steady_clock::now();
  int64_t rays = 0;
  do {
    parallel_for(0, camera.height, 4, [&](int64_t begin, int64_t end) {
      for (int64_t y = begin; y < end; ++y)
        for (int x = 0; x < camera.width; ++x)
          (void)scene.intersect(camera.ray(vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)));
    });
    rays += static_cast<int64_t>(camera.width) * camera.height;
  } while (seconds_since(start) < 0.5);
  return static_cast<double>(rays) / seconds_since(start);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Renders one view of an asset with patina's path tracer"};
  std::filesystem::path asset_path, out_path, environment_path;
  vec3 eye(0.0f), target(0.0f);
  float fov_degrees = 35.0f;
  int size = 512, samples = 64, depth = 8;
  bool show_environment = false, principled = false;
  std::vector<float> eye_values, target_values;
  app.add_option("asset", asset_path, "glTF, GLB or OBJ file")->required();
  app.add_option("out", out_path, "EXR (linear) or PNG (sRGB) to write")->required();
  app.add_option("--environment", environment_path, "equirectangular HDR; default: the built-in studio");
  app.add_option("--eye", eye_values, "world position of the camera, metres; default: in front, all in view")->expected(3);
  app.add_option("--target", target_values, "world position it looks at; default: the centre of the bounds")->expected(3);
  app.add_option("--fov", fov_degrees, "vertical field of view, degrees");
  app.add_option("--size", size, "pixels a side");
  app.add_option("--samples", samples, "paths a pixel");
  app.add_option("--depth", depth, "path segments after the camera ray");
  app.add_flag("--show-environment", show_environment, "show the environment behind the asset");
  app.add_flag("--principled", principled, "Burley's principled model instead of glTF's");
  CLI11_PARSE(app, argc, argv);

  try {
    const asset::Asset asset = asset::read_asset(asset_path);
    const asset::Bounds bounds = asset::bounds(asset);
    target = target_values.empty() ? bounds.center() : vec3(target_values[0], target_values[1], target_values[2]);
    const float distance = 1.05f * bounds.radius() / std::sin(0.5f * glm::radians(fov_degrees));
    eye = eye_values.empty() ? target + distance * glm::normalize(vec3(0.5f, 0.4f, 1.0f))
                             : vec3(eye_values[0], eye_values[1], eye_values[2]);

    auto start = std::chrono::steady_clock::now();
    render::Scene::Options scene_options;
    if (principled) scene_options.bsdf_model = render::BsdfModel::kPrincipled;
    const render::Scene scene(asset, asset::resolve_materials(asset),
                              environment_path.empty() ? render::studio_environment()
                                                       : render::read_environment(environment_path),
                              nullptr, scene_options);
    std::printf("scene: %.2f s\n", seconds_since(start));

    const render::Camera camera = render::look_at(eye, target, glm::radians(fov_degrees), size, size);
    render::PathOptions options;
    options.samples_per_pixel = samples;
    options.max_depth = depth;
    options.show_environment = show_environment;
    start = std::chrono::steady_clock::now();
    const render::Render result = render::render(scene, camera, options);
    const double seconds = seconds_since(start);
    const double paths = static_cast<double>(size) * size * samples;
    std::printf("render: %.2f s, %.3f M paths/s, %d threads\n", seconds, paths / seconds * 1e-6, num_threads());
    std::printf("camera rays alone: %.3f M/s\n", camera_rays_per_second(scene, camera) * 1e-6);

    write_image(out_path, out_path.extension() == ".exr" ? result.radiance : tone_map(result.radiance, 0.0f));
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
