// The last stage: renders the result with the path tracer, measures it, and shows it.
#include <fmt/format.h>

#include <cmath>

#include "patina/asset/map_slots.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/measures.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/stages.h"
#include "patina/report/report.h"

namespace patina::pipeline {

using nlohmann::json;

namespace {

std::vector<Image> read_numbered(const RunFolder& run, std::string_view prefix,
                                 const std::vector<render::Camera>& cameras) {
  std::vector<Image> images;
  for (size_t v = 0; v < cameras.size(); ++v)
    images.push_back(
        read_rgb_sized(run.file(numbered(prefix, v, ".png")), cameras[v].width, cameras[v].height));
  return images;
}

std::string report_key(const Workbench& bench, const RenderedViews& views, std::span<const Image> edited,
                       const FittedMaterials& fitted, const Config& config) {
  std::string key = values_read_by(config, kReportStage | kDetailStage).dump() + bench.scene_hash +
                    PATINA_VERSION + cameras_to_json(bench.cameras).dump() +
                    fmt::format("{}", views.set.exposure_ev);
  const auto add = [&](const Image& image) {
    key += hash_bytes(
        {reinterpret_cast<const uint8_t*>(image.pixels.data()), image.pixels.size() * sizeof(float)});
  };
  for (const Image& image : views.tile) add(image);
  for (const Image& image : edited) add(image);
  for (const asset::MaterialMaps& m : fitted.maps)
    for (const asset::MapSlotRow& row : asset::kMapSlots) add(slot_map(m, row.slot).texels);
  return hash_text(key);
}

std::vector<report::TexturePair> texture_pairs(const Workbench& bench, const FittedMaterials& fitted) {
  std::vector<report::TexturePair> pairs;
  for (size_t m = 0; m < fitted.maps.size(); ++m)
    for (const asset::MapSlotRow& row : asset::kMapSlots) {
      if (!has(fitted.changed[m], row.slot)) continue;
      const auto picture = [&](const asset::MaterialMaps& maps) {
        return asset::picture_of(slot_map(maps, row.slot).texels, row.encoding);
      };
      pairs.push_back({bench.maps[m].name, row.title, picture(bench.maps[m]), picture(fitted.maps[m])});
    }
  return pairs;
}

// metrics.json: the measures of all stages in one place.
json gather_metrics(const RunFolder& run, const json& measured) {
  json metrics = measured;
  if (const StageRecord* render = run.stage("render"))
    for (const auto& [name, value] : render->metrics.items()) metrics[name] = value;
  if (const StageRecord* detail = run.stage("detail")) {
    metrics["noise"] = detail->metrics.value("noise", json::object());
    for (const char* name : {"model", "guidance"}) metrics[name] = detail->metrics.value(name, json());
  }
  if (const StageRecord* fit = run.stage("fit")) {
    for (const char* name : {"training_psnr", "density"})
      metrics["fit"][name] = fit->metrics.value(name, json());
  }
  metrics["stages"] = json::array();
  for (const StageRecord& stage : run.stages())
    metrics["stages"].push_back(
        {{"name", stage.name}, {"seconds", stage.seconds}, {"peak_rss_mb", stage.peak_rss_mb}});
  return metrics;
}

}  // namespace

void report_stage(const Workbench& bench, const RenderedViews& views, std::span<const Image> edited,
                  const FittedMaterials& fitted, const Config& config, RunFolder& run,
                  const Progress& progress) {
  const StageRecord& record =
      run.run_stage("report", report_key(bench, views, edited, fitted, config), progress, [&] {
        RunFolder::StageResult result;
        const render::Scene after(bench.asset, fitted.maps, bench.scene->environment(), bench.context.get(),
                                  {.bsdf_model = config.bsdf});
        const views::ViewOptions options{.path = {.samples_per_pixel = config.samples_per_pixel,
                                                  .max_depth = config.max_depth,
                                                  .seed = config.seed},
                                         .exposure_ev = views.set.exposure_ev};
        const views::ViewSet rendered = views::render_views(after, bench.cameras, options, progress);
        std::vector<Image> pictures;
        for (size_t v = 0; v < rendered.views.size(); ++v) {
          pictures.push_back(views::tile_control(rendered.views[v], views.set.exposure_ev));
          result.outputs.push_back(numbered("report/rendered", v, ".png"));
          write_image(run.file(result.outputs.back()), pictures.back());
        }
        const std::vector<Image> weights = measure_weights(bench, views, config);
        result.metrics["consistency"] = consistency_metrics(bench, views, edited);
        result.metrics["fit"] = {
            {"psnr", json_number(mean_over_views(pictures, edited, weights, report::psnr))},
            {"sharpness", json_number(mean_over_views(pictures, edited, weights, report::sharpness_kept))},
            {"psnr_before", json_number(mean_over_views(views.tile, edited, weights, report::psnr))}};
        if (config.turntable_frames > 0) {
          views::OrbitOptions orbit = config.orbit;
          orbit.num_views = config.turntable_frames;
          orbit.elevations.resize(1);  // a turntable turns level
          orbit.resolution = std::min(config.orbit.resolution, 320);
          const auto cameras = views::orbit_cameras(asset::bounds(bench.asset), orbit);
          report::write_turntable(run.file("turntable.webp"), *bench.scene, after, cameras,
                                  {.frames = config.turntable_frames,
                                   .resolution = orbit.resolution,
                                   .samples_per_pixel = std::min(config.samples_per_pixel, 24),
                                   .exposure_ev = views.set.exposure_ev},
                                  progress);
          result.outputs.push_back("turntable.webp");
        }
        return result;
      });

  // The page is made anew every time: it is cheap, and tells of stages that ran again.
  report::ReportData page;
  page.title = bench.asset.path.filename().string();
  page.prompt = config.detail.prompt;
  page.negative_prompt = negative_prompt_of(run);
  page.before = views.tile;
  page.edited.assign(edited.begin(), edited.end());
  page.after = read_numbered(run, "report/rendered", bench.cameras);
  page.textures = texture_pairs(bench, fitted);
  if (const StageRecord* fit = run.stage("fit"))
    for (const json& loss : fit->metrics.value("loss", json::array()))
      page.loss.push_back(loss.is_number() ? loss.get<float>() : NAN);
  page.config = to_json(config);
  page.config["asset"] = config.asset.string();
  page.config["version"] = PATINA_VERSION;
  page.metrics = gather_metrics(run, record.metrics);
  page.warnings = bench.warnings;
  for (const StageRecord& stage : run.stages())
    page.warnings.insert(page.warnings.end(), stage.warnings.begin(), stage.warnings.end());
  if (config.turntable_frames > 0) page.turntable = "turntable.webp";
  write_json(run.file("metrics.json"), page.metrics);
  report::write_report(run.file("report.html"), page);
}

}  // namespace patina::pipeline
