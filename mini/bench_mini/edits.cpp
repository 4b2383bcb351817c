#include "edits.h"

namespace patina::bench {

namespace fs = std::filesystem;
using namespace pipeline;

Config edit_config(const HeldOutAsset& asset, const EditSettings& settings) {
  Config config;
  config.inputs.asset = asset.path;
  config.edit.model = settings.model;
  config.inputs.orbit.num_views = settings.num_views;
  config.inputs.orbit.resolution = settings.resolution;
  config.edit.options.num_steps = settings.num_steps;
  config.edit.options.guidance_scale = settings.guidance_scale;
  config.edit.options.negative_prompt = settings.negative_prompt;
  config.edit.options.fine_detail = settings.fine_detail;
  config.report.turntable_frames = 0;
  config.num_threads = settings.num_threads;
  return config;
}

AssetEditor::AssetEditor(const HeldOutAsset& asset, const EditSettings& settings, const fs::path& folder,
                         pipeline::ResolvedModel& model)
    : config_(edit_config(asset, settings)),
      folder_(folder / asset.name),
      model_(model),
      bench_(open_workbench(config_.inputs, {})) {
  RunFolder run(folder_ / "views");
  views_ = render_stage(bench_, config_.render, run, {});
  for (const views::View& view : views_.set.views) {
    Image coverage(view.gbuffer.width, view.gbuffer.height, 1);
    coverage.pixels = view.gbuffer.coverage;
    coverage_.push_back(std::move(coverage));
  }
}

std::vector<Image> AssetEditor::edited(const std::string& name, const std::string& prompt) const {
  pipeline::EditSettings settings = config_.edit;
  settings.options.prompt = prompt;
  RunFolder run(folder_ / name);
  return edit_stage(bench_, unmasked(bench_), views_, settings, model_, run, {});
}

}  // namespace patina::bench
