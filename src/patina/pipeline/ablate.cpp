#include "patina/pipeline/ablate.h"

#include <memory>
#include <set>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/base/processor.h"
#include "patina/pipeline/ablate_pictures.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/measures.h"
#include "patina/pipeline/option_kinds.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/stage_key.h"
#include "patina/report/html.h"
#include "patina/report/report.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using report::AblationMeasures;

constexpr int kMaxCrops = 3;

// A step with the run folder that it holds as long as the ablation works.
struct Run {
  AblationStep step;
  std::unique_ptr<RunFolder> folder;
};

Run open_run(const AblationStep& step) {
  Run run{step, std::make_unique<RunFolder>(step.config.run)};
  write_config(step.config, *run.folder);
  return run;
}

// A note that every step would repeat is said once.
RunProgress saying_once(const RunProgress& progress) {
  RunProgress once = progress;
  once.on_warning = [progress, said = std::make_shared<std::set<std::string>>()](std::string_view text) {
    if (said->emplace(text).second) progress.warn(text);
  };
  return once;
}

// Progress of one task inside of step `index` of `count`, told as progress over all steps. What is not run
// again is not told, so that the time left follows from what is.
RunProgress of_all_steps(const RunProgress& progress, std::string_view task, size_t index, size_t count,
                         std::string_view told_as) {
  RunProgress inner = progress;
  inner.on_update = [=, task = std::string(task), told_as = std::string(told_as)](std::string_view name,
                                                                                  double done, double total) {
    if (name == task)
      progress.update(told_as, static_cast<double>(index) + done / total, static_cast<double>(count));
  };
  return inner;
}

// Numbers that need the edited views alone: how well they agree, and how much detail they have over the
// renders.
void measure_stage(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                   std::span<const Image> edited, Run& run, const RunProgress& progress) {
  const int boundary_pixels = run.step.config.report.boundary_pixels;
  const std::string key = StageKey(bench)
                              .add_materials(strength.enhanced)
                              .add(fmt::format("{}", boundary_pixels))
                              .add(views.tile)
                              .add(edited)
                              .hash();
  run.folder->run_stage("measure", key, progress, [&] {
    const std::vector<Image> weights = measure_weights(strength, views, boundary_pixels);
    return RunFolder::StageResult{
        .outputs = {},
        .metrics = {{"consistency", consistency_metrics(bench, views, edited)},
                    {"edit_sharpness",
                     json_number(mean_over_views(edited, views.tile, weights, report::sharpness_kept))}},
        .warnings = {}};
  });
}

double number_at(const json& object, const std::string& pointer) {
  const json::json_pointer at(pointer);
  return object.contains(at) && object[at].is_number() ? object[at].get<double>() : report::kNotMeasured;
}

AblationMeasures measures_of(const RunFolder& run, bool fit) {
  AblationMeasures m;
  if (const StageRecord* detail = run.stage("detail")) {
    m.noise_seconds = number_at(detail->metrics, "/seconds/noise");
    m.correspond_seconds = number_at(detail->metrics, "/seconds/correspond");
    m.diffusion_seconds = detail->seconds - number_at(detail->metrics, "/seconds/load") - m.noise_seconds -
                          m.correspond_seconds;
    m.diffusion_mb = detail->peak_rss_mb;
  }
  if (const StageRecord* measure = run.stage("measure")) {
    m.edit_correlation = number_at(measure->metrics, "/consistency/edit_correlation");
    m.edit_psnr = number_at(measure->metrics, "/consistency/edit_psnr");
    m.edit_sharpness = number_at(measure->metrics, "/edit_sharpness");
  }
  if (!fit) return m;
  if (const StageRecord* record = run.stage("fit"))
    m.fit_seconds = record->seconds, m.fit_mb = record->peak_rss_mb;
  if (const StageRecord* record = run.stage("report")) {
    m.texture_sharpness = number_at(record->metrics, "/fit/sharpness");
    m.texture_psnr = number_at(record->metrics, "/fit/psnr");
  }
  return m;
}

json to_json(const AblationMeasures& m, bool fit) {
  json values = {{"edit_correlation", json_number(m.edit_correlation)},
                 {"edit_psnr", json_number(m.edit_psnr)},
                 {"edit_sharpness", json_number(m.edit_sharpness)},
                 {"seconds",
                  {{"noise", json_number(m.noise_seconds)},
                   {"correspond", json_number(m.correspond_seconds)},
                   {"diffusion", json_number(m.diffusion_seconds)}}},
                 {"peak_rss_mb", {{"diffusion", json_number(m.diffusion_mb)}}}};
  if (!fit) return values;
  values["texture_sharpness"] = json_number(m.texture_sharpness);
  values["texture_psnr"] = json_number(m.texture_psnr);
  values["seconds"]["fit"] = json_number(m.fit_seconds);
  values["peak_rss_mb"]["fit"] = json_number(m.fit_mb);
  return values;
}

json to_json(const report::ViewCountRow& row) {
  return {{"views", row.num_views},
          {"resolution", row.resolution},
          {"latent_pixels", row.num_latent_pixels},
          {"seconds",
           {{"noise", json_number(row.noise_seconds)},
            {"correspond", json_number(row.correspond_seconds)},
            {"diffusion", json_number(row.diffusion_seconds)}}},
          {"peak_rss_mb", json_number(row.diffusion_mb)}};
}

// The processor's name and the threads in use, without which seconds say little.
std::string machine_name() {
  return fmt::format("{}, {} thread{}", processor_name(), num_threads(), num_threads() == 1 ? "" : "s");
}

report::ViewCountRow view_count_row(const Run& run) {
  const AblationMeasures m = measures_of(*run.folder, false);
  const StageRecord* detail = run.folder->stage("detail");
  return {.num_views = run.step.config.inputs.orbit.num_views,
          .resolution = run.step.config.inputs.orbit.resolution,
          .num_latent_pixels = detail ? detail->metrics.value("latent_pixels", int64_t{0}) : 0,
          .noise_seconds = m.noise_seconds,
          .correspond_seconds = m.correspond_seconds,
          .diffusion_seconds = m.diffusion_seconds,
          .diffusion_mb = m.diffusion_mb};
}

// The last step once more for each further number of views, in `folder`/views-<number>.
std::vector<AblationStep> steps_of_more_views(const AblationStep& last, const AblationOptions& options,
                                              const fs::path& folder) {
  std::vector<AblationStep> steps;
  std::set<int> counts{last.config.inputs.orbit.num_views};
  for (const int count : options.view_counts) {
    if (!counts.insert(count).second) continue;
    if (!last.config.inputs.cameras.empty())
      throw Error(ErrorCode::kUsage, "views", "explicit cameras fix the number of views; give one");
    AblationStep step = last;
    step.config.inputs.orbit.num_views = count;
    step.config.run = folder / fmt::format("views-{}", count);
    steps.push_back(std::move(step));
  }
  return steps;
}

// Refuses an asset that cannot be used, and a point that is none, before folders are made and hours have
// passed.
void check_asset_and_point(const Config& config, const AblationOptions& options,
                           const RunProgress& progress) {
  const Workbench bench = open_workbench(config.inputs, progress);
  views::ViewSet views{.grid = views::grid_of(bench.cameras.size()), .exposure_ev = 0, .views = {}};
  for (const render::Camera& camera : bench.cameras)
    views.views.push_back({.camera = camera,
                           .gbuffer = views::make_gbuffer(*bench.scene, camera),
                           .radiance = {},
                           .coverage = {}});
  pick_point(*bench.scene, views, options.point);
}

// Renders the views once and edits them in every run of `runs`, which differ in nothing that renders depend
// on. Asset and G-buffers go when this returns, so that they do not count as another stage's memory.
void edit(std::span<Run> runs, std::string_view told_as, size_t first, size_t count, ResolvedModel& model,
          const RunProgress& progress) {
  const Workbench bench = open_workbench(runs[0].step.config.inputs, progress);
  const Strength strength = mask_stage(bench, runs[0].step.config.masks, *runs[0].folder, progress);
  const RenderedViews views = render_stage(bench, runs[0].step.config.render, *runs[0].folder, progress);
  for (size_t i = 0; i < runs.size(); ++i) {
    for (const char* stage : {"masks", "render"}) runs[i].folder->adopt_stage(*runs[0].folder, stage);
    edit_stage(bench, strength, views, runs[i].step.config.edit, model, *runs[i].folder,
               of_all_steps(progress, "detail", first + i, count, told_as));
  }
}

// Everything the page shows of the steps.
report::AblationPage make_page(const Workbench& bench, const RenderedViews& views, std::span<const Run> runs,
                               const AblationOptions& options, const Config& config) {
  const bool fit = options.fit;
  const PickedPoint point = pick_point(*bench.scene, views.set, options.point);
  const std::vector<CropWindow> windows = crop_windows(point, views.set, kMaxCrops);
  const auto add_textures = [&](report::AblationRow& row, const std::vector<asset::MaterialMaps>& maps) {
    TexturePictures pictures = texture_pictures(*bench.scene, views.set, point, maps);
    row.texture = std::move(pictures.whole), row.texture_crop = std::move(pictures.around_point);
  };

  report::AblationPage page;
  page.title = bench.asset.path.filename().string();
  page.prompt = config.edit.options.prompt,
  page.negative_prompt = prompts_of(*runs[0].folder).negative_prompt;
  for (const CropWindow& window : windows)
    page.crop_titles.push_back(fmt::format("View {}", window.view + 1));
  page.conditioning = pictures_of(views.tile, windows, true);
  page.conditioning.title = "Conditioning";
  page.conditioning.note = "the asset as it came; frames show the crops";
  if (fit) {
    add_textures(page.conditioning, bench.maps);
    page.conditioning.rendered_crop = page.conditioning.crops.front();
  }
  for (const Run& run : runs) {
    report::AblationRow row = pictures_of(load_edited(views, *run.folder), windows, false);
    row.title = run.step.title, row.note = run.step.note;
    row.measures = measures_of(*run.folder, fit);
    if (fit) {
      add_textures(row, load_fitted(bench, *run.folder).maps);
      const CropWindow& window = windows.front();
      const render::Camera& camera = bench.cameras[static_cast<size_t>(window.view)];
      const auto file = numbered("report/rendered", static_cast<size_t>(window.view), ".png");
      row.rendered_crop =
          cropped(read_rgb_sized(run.folder->file(file), camera.width, camera.height), window);
    }
    page.steps.push_back(std::move(row));
  }

  const render::Camera& camera = bench.cameras[0];
  page.facts = {
      fmt::format("<b>{}</b> views of <b>{} × {}</b>", bench.cameras.size(), camera.width, camera.height),
      fmt::format("<b>{}</b> steps at strength <b>{}</b>", config.edit.options.num_steps,
                  config.edit.options.strength),
      fmt::format("seed <b>{}</b>", config.edit.options.seed)};
  if (const StageRecord* detail = runs[0].folder->stage("detail"))
    page.facts.push_back(report::escaped(detail->metrics.value("model", "")));
  page.machine = machine_name();
  page.config = pipeline::to_json(runs[0].step.config);
  for (const char* set_by_the_steps : {"bias", "bias-scaling", "noise", "output", "run", "turntable"})
    page.config.erase(set_by_the_steps);
  page.config["tile-scale"] = find_option("tile-scale")->get(config);
  page.config["asset"] = option_kinds::text_of_path(config.inputs.asset);
  page.config["version"] = PATINA_VERSION;
  page.warnings = bench.warnings;
  if (const StageRecord* render = runs[0].folder->stage("render"))
    page.warnings.insert(page.warnings.end(), render->warnings.begin(), render->warnings.end());
  return page;
}

}  // namespace

json ablate(Config config, const AblationOptions& options, const fs::path& folder,
            const RunProgress& progress) {
  settle(config);
  const std::vector<AblationStep> steps = ablation_steps(config, options, folder);
  const std::vector<AblationStep> more_steps = steps_of_more_views(steps.back(), options, folder);
  std::vector<Run> runs, more_runs;
  for (const AblationStep& step : steps) check_inputs(step.config);
  ResolvedModel model(config.edit);
  const RunProgress once = saying_once(progress);
  check_asset_and_point(steps[0].config, options, once);
  for (const AblationStep& step : steps) runs.push_back(open_run(step));
  for (const AblationStep& step : more_steps) more_runs.push_back(open_run(step));

  // All edits first, with one model; then it goes, so that its memory does not count as the fit's.
  edit(runs, "edit steps", 0, runs.size(), model, once);
  for (size_t i = 0; i < more_runs.size(); ++i)
    edit({&more_runs[i], 1}, "more views", i, more_runs.size(), model, once);
  model.unload();

  const Workbench bench = open_workbench(runs[0].step.config.inputs, once);
  const Strength strength = mask_stage(bench, runs[0].step.config.masks, *runs[0].folder, once);
  const RenderedViews views = load_views(bench, *runs[0].folder);
  for (size_t i = 0; i < runs.size(); ++i) {
    const std::vector<Image> edited = load_edited(views, *runs[i].folder);
    measure_stage(bench, strength, views, edited, runs[i], once);
    if (!options.fit) continue;
    const RunProgress inner = of_all_steps(once, "fit", i, runs.size(), "fit steps");
    const FittedMaterials fitted =
        fit_stage(bench, strength, views, edited, runs[i].step.config.fit, *runs[i].folder, inner);
    report_stage(bench, strength, views, edited, fitted, runs[i].step.config.report, *runs[i].folder, inner);
  }

  report::AblationPage page = make_page(bench, views, runs, options, config);
  json result = {{"patina", PATINA_VERSION},      {"asset", option_kinds::text_of_path(config.inputs.asset)},
                 {"options", page.config},        {"machine", page.machine},
                 {"views", bench.cameras.size()}, {"steps", json::array()},
                 {"view_counts", json::array()}};
  for (size_t i = 0; i < runs.size(); ++i) {
    json step = to_json(page.steps[i].measures, options.fit);
    step["name"] = runs[i].step.name;
    step["title"] = runs[i].step.title, step["note"] = runs[i].step.note;
    step["run"] = fs::relative(runs[i].step.config.run, folder).string();
    result["steps"].push_back(std::move(step));
  }
  if (!more_runs.empty()) {
    page.view_count_step = fmt::format("{}, {}", runs.back().step.title, runs.back().step.note);
    page.view_counts.push_back(view_count_row(runs.back()));
    for (const Run& run : more_runs) page.view_counts.push_back(view_count_row(run));
    for (const report::ViewCountRow& row : page.view_counts) result["view_counts"].push_back(to_json(row));
  }
  write_json(folder / "ablation.json", result);
  report::write_ablation_page(folder / "ablation.html", page);
  return result;
}

}  // namespace patina::pipeline
