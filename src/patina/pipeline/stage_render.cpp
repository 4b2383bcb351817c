// The first stage: the asset seen from every camera, as radiance and as the two control images.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "patina/base/error.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/stage_key.h"
#include "patina/pipeline/stages.h"
#include "patina/views/visibility.h"

namespace patina::pipeline {

namespace fs = std::filesystem;
using nlohmann::json;

std::string numbered(std::string_view prefix, size_t index, std::string_view extension) {
  return fmt::format("{}_{:02}{}", prefix, index, extension);
}

Image read_rgb_sized(const fs::path& path, int width, int height) {
  const Image stored = read_image(path);
  if (stored.width != width || stored.height != height || stored.channels < 3)
    throw Error(ErrorCode::kFormat, path.string(),
                fmt::format("expected {} x {} RGB, found {} x {} with {} channel(s); save an edited picture "
                            "at its old size, or run the stage again",
                            width, height, stored.width, stored.height, stored.channels));
  Image rgb(width, height, 3);
  for (size_t i = 0; i < rgb.num_pixels(); ++i)
    for (size_t c = 0; c < 3; ++c)
      rgb.pixels[3 * i + c] = stored.pixels[static_cast<size_t>(stored.channels) * i + c];
  return rgb;
}

namespace {

// What to do where a part of the surface is not seen for a reason that more views would not mend; empty:
// there is none such.
std::string advice_on_unseen(const Workbench& bench) {
  constexpr float kMuch = 0.1f;
  const views::UnseenCauses causes = views::unseen_causes(*bench.scene, bench.cameras);
  if (causes.turned_away > std::max(causes.transparent, kMuch))
    return fmt::format(
        "Of {:.0f} % of the surface the views see only the back: its faces point inwards. Turn them round "
        "(Blender: Edit Mode, Mesh > Normals > Recalculate Outside), or make the material double-sided.",
        100 * causes.turned_away);
  if (causes.transparent > kMuch)
    return fmt::format(
        "{:.0f} % of the surface is not seen because it is transparent (alpha below 0.5, or below the "
        "cutoff); make it opaque to have it enhanced.",
        100 * causes.transparent);
  return "";
}

json coverage_metrics(const Workbench& bench, const RunProgress& progress,
                      std::vector<std::string>& warnings) {
  const float seen = views::seen_share(*bench.scene, bench.cameras);
  if (seen < 0.85f) {
    const std::string advice = advice_on_unseen(bench);
    warnings.push_back(fmt::format(
        "The views see {:.0f} % of the surface. {} Unseen surface is filled with the change around it, or "
        "kept.",
        100 * seen,
        advice.empty() ? "More views (16) or several elevations (-20, 20 and 50) see more." : advice));
    progress.warn(warnings.back());
  }
  return {{"coverage", seen}, {"coverage_twice", views::seen_share(*bench.scene, bench.cameras, 2)}};
}

// A run that cannot change anything ends before diffusion starts.
void require_seen(const Workbench& bench, const views::ViewSet& set) {
  for (const views::View& view : set.views)
    for (const auto material : view.gbuffer.material)
      if (material >= 0 && static_cast<size_t>(material) < bench.chosen.size() &&
          bench.chosen[static_cast<size_t>(material)])
        return;
  const std::string advice = advice_on_unseen(bench);
  throw Error(ErrorCode::kFormat, bench.asset.path.string(),
              "no pixel of any view shows a material that may change, so nothing would be enhanced. " +
                  (advice.empty() ? "Check the cameras and the materials that were chosen." : advice));
}

}  // namespace

RenderedViews render_stage(const Workbench& bench, const RenderSettings& settings, RunFolder& run,
                           const RunProgress& progress) {
  const std::string key = StageKey(bench, settings).hash();
  run.run_stage("render", key, progress, [&] {
    const views::ViewOptions options{.path = {.samples_per_pixel = settings.samples_per_pixel,
                                              .max_depth = settings.max_depth,
                                              .seed = settings.seed},
                                     .exposure_ev = settings.exposure_ev};
    const views::ViewSet set = views::render_views(*bench.scene, bench.cameras, options, progress);

    RunFolder::StageResult result;
    const auto write = [&](const std::string& name, const Image& image) {
      write_image(run.output(name), image);
      result.outputs.push_back(name);
    };
    for (size_t v = 0; v < set.views.size(); ++v) {
      write(numbered("views/tile", v, ".png"), views::tile_control(set.views[v], set.exposure_ev));
      write(numbered("views/normal", v, ".png"), views::normal_control(set.views[v]));
      write(numbered("views/radiance", v, ".exr"), set.views[v].radiance);
    }
    json cameras = cameras_to_json(bench.cameras);
    cameras["exposure_ev"] = set.exposure_ev;
    const glm::dvec3& origin = bench.asset.origin;
    if (origin != glm::dvec3(0.0)) cameras["origin"] = {origin.x, origin.y, origin.z};
    write_json(run.output("views/cameras.json"), cameras);
    result.outputs.push_back("views/cameras.json");
    result.metrics = coverage_metrics(bench, progress, result.warnings);
    result.metrics["exposure_ev"] = set.exposure_ev;
    return result;
  });
  return load_views(bench, run);
}

RenderedViews load_views(const Workbench& bench, const RunFolder& run) {
  if (!run.stage("render"))
    throw Error(ErrorCode::kNotFound, run.path().string(),
                "has no rendered views yet; `patina render` makes them");
  RenderedViews views;
  const json cameras = read_json(run.file("views/cameras.json"));
  views.set.grid = static_cast<int>(std::lround(std::sqrt(static_cast<double>(bench.cameras.size()))));
  views.set.exposure_ev = cameras.value("exposure_ev", 0.0f);
  for (size_t v = 0; v < bench.cameras.size(); ++v) {
    const render::Camera& camera = bench.cameras[v];
    views.tile.push_back(
        read_rgb_sized(run.file(numbered("views/tile", v, ".png")), camera.width, camera.height));
    views.normal.push_back(
        read_rgb_sized(run.file(numbered("views/normal", v, ".png")), camera.width, camera.height));
    views.set.views.push_back({.camera = camera,
                               .gbuffer = views::make_gbuffer(*bench.scene, camera),
                               .radiance = {},
                               .coverage = {}});
  }
  require_seen(bench, views.set);
  return views;
}

}  // namespace patina::pipeline
