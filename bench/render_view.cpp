// Renders one view of an asset to an EXR (linear) or PNG (sRGB) file and says how fast: paths a second, and
// for comparison how many camera rays a second the same scene answers when nothing is shaded. With
// --reference it also compares the render with another one of the same view; bench/compare_cycles.py does so
// with Blender's Cycles.
#include <cstdio>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "console/numbers.h"
#include "console/program.h"
#include "patina/base/clock.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/parallel.h"
#include "patina/image/color.h"
#include "patina/image/image_io.h"
#include "patina/render/path_tracer.h"

namespace {

using namespace patina;

/// Camera rays a second that `scene` answers when nothing is shaded.
double camera_rays_per_second(const render::Scene& scene, const render::Camera& camera) {
  const auto start = Clock::now();
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

/// How a render differs from a reference over the pixels that the asset covers wholly; how noisy it is, a
/// render with another seed tells.
nlohmann::json compare(const render::Render& render, const render::Render& again, const Image& reference,
                       float exposure_ev) {
  glm::dvec3 sum(0.0), reference_sum(0.0), absolute(0.0);
  double display_absolute = 0, display_squared = 0, noise = 0;
  int64_t pixels = 0;
  const Image display = tone_map(render.radiance, exposure_ev);
  const Image reference_display = tone_map(reference, exposure_ev);
  for (int y = 0; y < reference.height; ++y)
    for (int x = 0; x < reference.width; ++x) {
      if (render.coverage.at(x, y)[0] < 1.0f) continue;
      const glm::dvec3 a(render.radiance.rgb(x, y)), b(reference.rgb(x, y));
      sum += a, reference_sum += b, absolute += glm::abs(a - b);
      const glm::dvec3 change = a - glm::dvec3(again.radiance.rgb(x, y));
      noise += glm::dot(change, change) / 6.0;
      const glm::dvec3 d(display.rgb(x, y) - reference_display.rgb(x, y));
      display_absolute += (std::abs(d.x) + std::abs(d.y) + std::abs(d.z)) / 3.0;
      display_squared += glm::dot(d, d) / 3.0;
      ++pixels;
    }
  const double n = static_cast<double>(std::max<int64_t>(pixels, 1));
  const glm::dvec3 ratio = sum / reference_sum;
  const auto total = [](const glm::dvec3& v) { return v.x + v.y + v.z; };
  return {{"pixels", pixels},
          {"mean_patina", total(sum) / (3 * n)},
          {"mean_reference", total(reference_sum) / (3 * n)},
          {"mean_ratio", total(sum) / total(reference_sum)},
          {"mean_ratio_rgb", {ratio.x, ratio.y, ratio.z}},
          {"relative_mean_absolute_difference", total(absolute) / total(reference_sum)},
          {"relative_noise_of_patina", std::sqrt(noise / n) / (total(sum) / (3 * n))},
          {"display_mean_absolute_difference", display_absolute / n},
          {"display_psnr_db", -10.0 * std::log10(display_squared / n)}};
}

/// Render, reference, and ½ + 4 × their difference beside each other; [H, 3W, 3] sRGB.
Image side_by_side(const Image& radiance, const Image& reference, float exposure_ev) {
  const Image a = tone_map(radiance, exposure_ev), b = tone_map(reference, exposure_ev);
  Image out(3 * a.width, a.height, 3);
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) {
      out.set_rgb(x, y, a.rgb(x, y));
      out.set_rgb(x + a.width, y, b.rgb(x, y));
      out.set_rgb(x + 2 * a.width, y,
                  glm::clamp(vec3(0.5f) + 4.0f * (a.rgb(x, y) - b.rgb(x, y)), 0.0f, 1.0f));
    }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Renders one view of an asset with patina's path tracer", "bench_render_view");
  std::filesystem::path asset_path, out_path, environment_path, reference_path, picture_path, report_path;
  float fov_degrees = 35.0f, exposure_ev = 0.0f;
  int size = 512, samples = 64, depth = 8;
  bool show_environment = false, principled = false;
  std::vector<float> eye_values, target_values;
  app.add_option("asset", asset_path, "glTF, GLB or OBJ file")->required();
  app.add_option("out", out_path, "EXR (linear) or PNG (sRGB) to write")->required();
  app.add_option("--environment", environment_path, "equirectangular HDR; default: the built-in studio");
  app.add_option("--eye", eye_values, "world position of the camera, metres; default: in front, all in view")
      ->expected(3)
      ->check(tools::number());
  app.add_option("--target", target_values, "world position it looks at; default: the centre of the bounds")
      ->expected(3)
      ->check(tools::number());
  app.add_option("--fov", fov_degrees, "vertical field of view, degrees")->check(tools::positive_number());
  app.add_option("--size", size, "pixels a side")->check(tools::whole_number(1));
  app.add_option("--samples", samples, "paths a pixel")->check(tools::whole_number(1));
  app.add_option("--depth", depth, "path segments after the camera ray")->check(tools::whole_number(1));
  app.add_option("--exposure", exposure_ev, "of PNG files, stops")->check(tools::number());
  app.add_flag("--show-environment", show_environment, "show the environment behind the asset");
  app.add_flag("--principled", principled, "Burley's principled model instead of glTF's");
  app.add_option("--reference", reference_path, "EXR of the same view and size to compare with");
  app.add_option("--picture", picture_path, "PNG to write: render, reference, 4 x their difference")
      ->needs("--reference");
  app.add_option("--report", report_path, "JSON to write: what differs by how much")->needs("--reference");
  return tools::run_program(app, argc, argv, [&] {
    const asset::Asset asset = asset::read_asset(asset_path);
    const asset::Bounds bounds = asset::bounds(asset);
    const vec3 target =
        target_values.empty() ? bounds.center() : vec3(target_values[0], target_values[1], target_values[2]);
    const float distance = 1.05f * bounds.radius() / std::sin(0.5f * glm::radians(fov_degrees));
    const vec3 eye = eye_values.empty() ? target + distance * glm::normalize(vec3(0.5f, 0.4f, 1.0f))
                                        : vec3(eye_values[0], eye_values[1], eye_values[2]);

    auto start = Clock::now();
    render::Scene::Options scene_options;
    if (principled) scene_options.bsdf_model = render::BsdfModel::kPrincipled;
    const render::Scene scene(
        asset, asset::resolve_materials(asset),
        environment_path.empty() ? render::studio_environment() : render::read_environment(environment_path),
        nullptr, scene_options);
    std::printf("scene: %.2f s\n", seconds_since(start));

    const render::Camera camera = render::look_at(eye, target, glm::radians(fov_degrees), size, size);
    render::PathOptions options;
    options.samples_per_pixel = samples;
    options.max_depth = depth;
    options.show_environment = show_environment;
    start = Clock::now();
    const render::Render result = render::render(scene, camera, options);
    const double seconds = seconds_since(start);
    const double paths = static_cast<double>(size) * size * samples;
    std::printf("render: %.2f s, %.3f M paths/s, %d threads\n", seconds, paths / seconds * 1e-6,
                num_threads());
    std::printf("camera rays alone: %.3f M/s\n", camera_rays_per_second(scene, camera) * 1e-6);

    write_image(out_path,
                out_path.extension() == ".exr" ? result.radiance : tone_map(result.radiance, exposure_ev));
    if (!reference_path.empty()) {
      const Image reference = read_hdr(reference_path);
      if (reference.width != size || reference.height != size)
        throw Error(ErrorCode::kUsage, reference_path.string(), "the reference must have the render's size");
      options.seed = 1;
      nlohmann::json report = compare(result, render::render(scene, camera, options), reference, exposure_ev);
      report["seconds"] = seconds;
      report["samples"] = samples;
      std::printf("%s\n", report.dump(2).c_str());
      if (!picture_path.empty())
        write_image(picture_path, side_by_side(result.radiance, reference, exposure_ev));
      if (!report_path.empty()) write_file(report_path, report.dump(2) + "\n");
    }
  });
}
