#include "patina/pipeline/enhance.h"

#include <unistd.h>

#include <fmt/format.h>

#include "patina/asset/export.h"
#include "patina/asset/json_view.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/diffusion/model.h"
#include "patina/pipeline/blend.h"
#include "patina/pipeline/exemplars.h"
#include "patina/pipeline/known_words.h"
#include "patina/pipeline/option_kinds.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/part_prompts.h"
#include "patina/pipeline/variants.h"

namespace patina::pipeline {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// Refuses at the start what export would refuse at the end.
void check_export(const Workbench& bench, const fs::path& output, const Progress& progress) {
  if (output.empty()) return;
  for (const std::string& note : asset::plan_export(bench.asset, output).notes) progress.warn(note);
}

std::vector<fs::path> files_of(const Workbench& bench, const ResolvedModel& model) {
  std::vector<fs::path> files = asset::files_of(bench.asset);
  files.insert(files.end(), model.files().begin(), model.files().end());
  if (!bench.context) return files;
  const std::vector<fs::path> context = asset::files_of(*bench.context);
  files.insert(files.end(), context.begin(), context.end());
  return files;
}

}  // namespace

std::vector<fs::path> enhance(Config config, RunFolder& run, const RunProgress& progress) {
  ModelShelf models(/*keeps=*/false);
  return enhance(std::move(config), run, progress, models);
}

std::vector<fs::path> enhance(Config config, RunFolder& run, const RunProgress& progress,
                              ModelShelf& models) {
  settle(config);
  check_inputs(config);
  std::shared_ptr<ResolvedModel> model = models.take(config.edit);
  warn_of_unknown_words(config.edit, progress);
  write_config(config, run);
  const Workbench bench = open_workbench(config.inputs, progress);  // asset, scene, cameras
  std::vector<fs::path> files = files_of(bench, *model);
  check_export(bench, config.output, progress);
  const Strength strength = mask_stage(bench, config.masks, run, progress);  // → masks/
  // Refuse what is wrong with them before anything is rendered.
  part_prompts(bench, strength, config.edit);
  read_exemplars(bench, strength, config.edit);
  const RenderedViews views = render_stage(bench, config.render, run, progress);  // → views/
  if (only_edits(config)) {
    edit_variants(bench, strength, views, config, *model, run, progress);
    return files;
  }
  const std::vector<Image> edited =
      edit_stage(bench, strength, views, config.edit, *model, run, progress);  // → detail/
  model.reset();
  FittedMaterials fitted =
      fit_stage(bench, strength, views, edited, config.fit, run, progress);  // → textures/
  fitted = blended(bench, std::move(fitted), config.blend);
  write_output(bench, fitted, config.output);                                          // → the asset
  report_stage(bench, strength, views, edited, fitted, config.report, run, progress);  // → report.html
  return files;
}

void run_render(Config config, RunFolder& run, const RunProgress& progress) {
  settle(config);
  check_output(config.output);
  write_config(config, run);
  const Workbench bench = open_workbench(config.inputs, progress);
  check_export(bench, config.output, progress);
  render_stage(bench, config.render, run, progress);
}

void run_edit(Config config, RunFolder& run, const RunProgress& progress) {
  settle(config);
  ResolvedModel model(config.edit);
  warn_of_unknown_words(config.edit, progress);
  write_config(config, run);
  const Workbench bench = open_workbench(config.inputs, progress);
  const Strength strength = mask_stage(bench, config.masks, run, progress);
  const RenderedViews views = load_views(bench, run);
  if (config.num_seeds > 1) return edit_variants(bench, strength, views, config, model, run, progress);
  edit_stage(bench, strength, views, config.edit, model, run, progress);
}

void run_fit(Config config, RunFolder& run, const RunProgress& progress) {
  settle(config);
  check_output(config.output);
  write_config(config, run);
  const Workbench bench = open_workbench(config.inputs, progress);
  check_export(bench, config.output, progress);
  const Strength strength = mask_stage(bench, config.masks, run, progress);
  const RenderedViews views = load_views(bench, run);
  const std::vector<Image> edited = load_edited(views, run);
  FittedMaterials fitted = fit_stage(bench, strength, views, edited, config.fit, run, progress);
  write_output(bench, blended(bench, std::move(fitted), config.blend), config.output);
}

void run_report(Config config, RunFolder& run, const RunProgress& progress) {
  settle(config);
  write_config(config, run);
  const Workbench bench = open_workbench(config.inputs, progress);
  const Strength strength = mask_stage(bench, config.masks, run, progress);
  const RenderedViews views = load_views(bench, run);
  const FittedMaterials fitted = blended(bench, load_fitted(bench, run), config.blend);
  report_stage(bench, strength, views, load_edited(views, run), fitted, config.report, run, progress);
}

void check_inputs(const Config& config) {
  // A U-Net halves the views three times, and each level's attention needs its own correspondences.
  const int resolution = config.inputs.orbit.resolution;
  if (config.edit.options.bias_weight != 0 && config.inputs.cameras.empty() && resolution % 64 != 0)
    throw Error(ErrorCode::kUsage, "resolution",
                fmt::format("expected a multiple of 64, or any multiple of 8 with the attention bias off, "
                            "found {}",
                            resolution));
  check_output(config.output);
}

void check_output(const fs::path& output) {
  if (output.empty()) return;
  const std::string extension = lowered(output.extension().string());
  if (extension != ".glb" && extension != ".gltf" && extension != ".obj")
    throw Error(ErrorCode::kUsage, "output",
                fmt::format("expected a name that ends in .glb, .gltf or .obj, found '{}'",
                            printable(output.string())));
  // A file that is made and removed beside the output tells whether the output can be written.
  const fs::path probe = output.parent_path() / fmt::format(".patina-probe.{}", ::getpid());
  write_file(probe, std::string_view());
  std::error_code ignored;
  fs::remove(probe, ignored);
}

void write_output(const Workbench& bench, const FittedMaterials& fitted, const fs::path& output) {
  if (!output.empty()) asset::export_asset(bench.asset, fitted.maps, fitted.changed, output);
}

fs::path run_folder_path(const Config& config) {
  if (!config.run.empty()) return config.run;
  if (config.output.empty())
    throw Error(ErrorCode::kUsage, "output", "give an output, e.g. rusty.glb, or a run folder");
  return config.output.parent_path() / (config.output.stem().string() + ".patina-run");
}

void write_config(const Config& config, RunFolder& run) {
  const fs::path file = run.file("config.json");
  const std::string asset = option_kinds::text_of_path(fs::absolute(config.inputs.asset));
  const std::string hash = hash_file(config.inputs.asset);
  if (fs::exists(file)) {
    const json before = read_json(file);
    const auto differs = [&](const char* name, const std::string& value) {
      return !before.is_object() || !before.contains(name) || before[name] != value;
    };
    if (differs("asset", asset) && differs("asset_hash", hash)) run.clear();
  }
  run.keep_what_was_changed_by_hand(config.keep);
  write_json(
      file,
      {{"patina", PATINA_VERSION}, {"asset", asset}, {"asset_hash", hash}, {"options", to_json(config)}});
}

Config read_config(const fs::path& run_folder) {
  const fs::path file = run_folder / "config.json";
  if (!fs::exists(file))
    throw Error(ErrorCode::kNotFound, run_folder.string(),
                "is not a run folder (it has no config.json); `patina render` makes one");
  const json values = read_json(file);
  Config config;
  try {
    config.inputs.asset = option_kinds::path_of_text(values.at("asset").get<std::string>());
    apply_json(config, values.at("options"), file.string());
  } catch (const json::exception& e) {
    throw Error(ErrorCode::kFormat, file.string(),
                fmt::format("is not a patina configuration: {}", asset::json_fault(e)));
  }
  std::error_code ignored;
  if (!fs::exists(config.inputs.asset, ignored))
    throw Error(
        ErrorCode::kNotFound, file.string(),
        fmt::format("its asset '{}' is no longer there; put it back, or give its new place to `patina "
                    "enhance` or `patina render` with this run folder, which go on from here",
                    printable(config.inputs.asset.string())));
  config.run = run_folder;
  config.keep = false, config.num_seeds = 1;  // asked for anew each time
  return config;
}

}  // namespace patina::pipeline
