// The last stage: renders the result with the path tracer, measures it, and shows it.
#include <fmt/format.h>

#include <cmath>

#include "patina/asset/map_slots.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/measures.h"
#include "patina/pipeline/relight.h"
#include "patina/pipeline/stage_key.h"
#include "patina/pipeline/stages.h"
#include "patina/pipeline/what_changed.h"
#include "patina/report/report.h"
#include "patina/report/viewer.h"

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

std::string report_key(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                       std::span<const Image> edited, const FittedMaterials& fitted,
                       const ReportSettings& settings) {
  StageKey key(bench, settings);
  key.add("in two other lights")
      .add_materials(strength.enhanced)
      .add(views.set.exposure_ev)
      .add(views.tile)
      .add(edited);
  for (const asset::MaterialMaps& m : fitted.maps)
    for (const asset::MapSlotRow& row : asset::kMapSlots) key.add(slot_map(m, row.slot).texels);
  return key.hash();
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

// One turn at the height of the usual orbit, with the whole asset in view, whatever cameras the views had.
void write_turntable(const Workbench& bench, const render::Scene& after, float exposure_ev,
                     const ReportSettings& settings, const std::filesystem::path& path,
                     const RunProgress& progress) {
  constexpr int kMaxPixels = 320, kMaxSamples = 24;
  const int resolution = std::min(bench.cameras[0].width, kMaxPixels);
  const auto cameras =
      views::orbit_cameras(asset::bounds(bench.asset), {.num_views = 1, .resolution = resolution});
  report::write_turntable(path, *bench.scene, after, cameras,
                          {.frames = settings.turntable_frames,
                           .resolution = resolution,
                           .samples_per_pixel = std::min(settings.samples_per_pixel, kMaxSamples),
                           .max_depth = settings.max_depth,
                           .seed = settings.seed,
                           .exposure_ev = exposure_ev},
                          progress);
}

// Renders the result and measures it.
RunFolder::StageResult measure_result(const Workbench& bench, const Strength& strength,
                                      const RenderedViews& views, std::span<const Image> edited,
                                      const FittedMaterials& fitted, const ReportSettings& settings,
                                      RunFolder& run, const RunProgress& progress) {
  RunFolder::StageResult result;
  const render::Scene after(bench.asset, fitted.maps, bench.scene->environment(), bench.context.get(),
                            {.bsdf_model = bench.scene->bsdf_model()});
  const views::ViewOptions options{.path = {.samples_per_pixel = settings.samples_per_pixel,
                                            .max_depth = settings.max_depth,
                                            .seed = settings.seed},
                                   .exposure_ev = views.set.exposure_ev};
  const views::ViewSet rendered = views::render_views(after, bench.cameras, options, progress);
  std::vector<Image> pictures;
  for (size_t v = 0; v < rendered.views.size(); ++v) {
    pictures.push_back(views::tile_control(rendered.views[v], views.set.exposure_ev));
    result.outputs.push_back(numbered("report/rendered", v, ".png"));
    write_image(run.output(result.outputs.back()), pictures.back());
  }
  const std::vector<Image> weights = measure_weights(strength, views, settings.boundary_pixels);
  result.metrics["consistency"] = consistency_metrics(bench, views, edited);
  result.metrics["fit"] = {
      {"psnr", json_number(mean_over_views(pictures, edited, weights, report::psnr))},
      {"sharpness", json_number(mean_over_views(pictures, edited, weights, report::sharpness_kept))},
      {"psnr_before", json_number(mean_over_views(views.tile, edited, weights, report::psnr))}};
  result.metrics["materials"] = what_changed(bench, fitted);
  result.metrics["unseen"] = what_was_not_seen(bench);
  result.metrics["relight"] =
      relight(bench, views, edited, pictures, weights, fitted, settings, run, result.outputs, progress);
  if (settings.turntable_frames > 0) {
    result.outputs.push_back("turntable.webp");
    write_turntable(bench, after, views.set.exposure_ev, settings, run.output(result.outputs.back()),
                    progress);
  }
  return result;
}

// The asset that turns under the mouse, in the light of the views first.
std::string viewer(const Workbench& bench, const FittedMaterials& fitted, std::span<const OtherLight> others,
                   const json& relit, float exposure_ev) {
  std::vector<report::ViewerLight> lights{{"Of the views", &bench.scene->environment(), exposure_ev}};
  for (size_t i = 0; i < others.size(); ++i)
    lights.push_back({others[i].title, &others[i].environment, relit.at("lights").at(i).at("exposure_ev")});
  return report::viewer_data({&bench.asset, bench.maps, fitted.maps, fitted.changed, lights});
}

std::vector<report::RelitPictures> relit_pictures(const Workbench& bench, std::span<const OtherLight> lights,
                                                  const RunFolder& run) {
  std::vector<report::RelitPictures> all;
  const std::vector<render::Camera> cameras = relight_cameras(bench);
  for (const OtherLight& light : lights) {
    report::RelitPictures pictures{.light = light.title, .before = {}, .after = {}};
    for (size_t v = 0; v < cameras.size(); ++v)
      for (const bool after : {false, true})
        (after ? pictures.after : pictures.before)
            .push_back(read_rgb_sized(run.file(relit_picture(light, after, v)), cameras[v].width,
                                      cameras[v].height));
    all.push_back(std::move(pictures));
  }
  return all;
}

// The masks of the materials that have one.
std::vector<report::MaskPicture> mask_pictures(const Workbench& bench, const Strength& strength) {
  std::vector<report::MaskPicture> pictures;
  for (size_t m = 0; m < strength.maps.size(); ++m)
    if (const Image& texels = strength.maps[m].texels; texels.num_pixels() > 1)
      pictures.push_back({bench.maps[m].name, texels});
  return pictures;
}

// The parts with words of their own.
std::vector<report::PartWords> part_words(const RunFolder& run) {
  std::vector<report::PartWords> words;
  const StageRecord* edit = run.stage("detail");
  if (!edit) return words;
  for (const json& part : edit->metrics.value("parts", json::array()))
    words.push_back({part.at("materials").get<std::vector<std::string>>(), part.at("prompt"),
                     part.at("negative_prompt").is_null() ? "" : part.at("negative_prompt"),
                     part.at("color")});
  return words;
}

std::vector<report::ExemplarPicture> exemplar_pictures(const Workbench& bench, const RunFolder& run) {
  std::vector<report::ExemplarPicture> pictures;
  const StageRecord* edit = run.stage("detail");
  if (!edit) return pictures;
  for (const json& exemplar : edit->metrics.value("exemplars", json::array()))
    pictures.push_back(
        {exemplar.at("caption"), read_rgb_sized(run.file(exemplar.at("file").get<std::string>()),
                                                bench.cameras[0].width, bench.cameras[0].height)});
  return pictures;
}

// What the page says the run was asked for: config.json, as `patina` writes it.
json asked_for(const RunFolder& run) {
  const json config = read_json(run.file("config.json"));
  json asked = config.value("options", json::object());
  asked["asset"] = config.value("asset", "");
  asked["version"] = config.value("patina", "");
  return asked;
}

}  // namespace

void report_stage(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                  std::span<const Image> edited, const FittedMaterials& fitted,
                  const ReportSettings& settings, RunFolder& run, const RunProgress& progress) {
  const std::string key = report_key(bench, strength, views, edited, fitted, settings);
  const StageRecord& record = run.run_stage("report", key, progress, [&] {
    return measure_result(bench, strength, views, edited, fitted, settings, run, progress);
  });

  // The page is made anew every time: it is cheap, and shows stages that ran again.
  report::ReportData page;
  page.title = bench.asset.path.filename().string();
  const Prompts prompts = prompts_of(run);
  page.prompt = prompts.prompt, page.negative_prompt = prompts.negative_prompt;
  page.before = views.tile;
  page.edited.assign(edited.begin(), edited.end());
  page.after = read_numbered(run, "report/rendered", bench.cameras);
  page.textures = texture_pairs(bench, fitted);
  if (const StageRecord* fit = run.stage("fit"))
    for (const json& loss : fit->metrics.value("loss", json::array()))
      page.loss.push_back(loss.is_number() ? loss.get<float>() : NAN);
  const std::vector<OtherLight> lights = other_lights(bench);
  page.relit = relit_pictures(bench, lights, run);
  page.masks = mask_pictures(bench, strength);
  page.strength = strength.views;
  page.exemplars = exemplar_pictures(bench, run);
  page.parts = part_words(run);
  if (!page.parts.empty()) page.part_views = read_numbered(run, "detail/parts", bench.cameras);
  page.viewer = viewer(bench, fitted, lights, record.metrics.at("relight"), views.set.exposure_ev);
  page.config = asked_for(run);
  page.metrics = gather_metrics(run, record.metrics);
  page.warnings = bench.warnings;
  for (const StageRecord& stage : run.stages())
    page.warnings.insert(page.warnings.end(), stage.warnings.begin(), stage.warnings.end());
  if (settings.turntable_frames > 0) page.turntable = "turntable.webp";
  write_json(run.file("metrics.json"), page.metrics);
  report::write_report(run.file("report.html"), page);
}

}  // namespace patina::pipeline
