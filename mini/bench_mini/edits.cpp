#include "edits.h"

namespace patina::bench {

namespace fs = std::filesystem;
using namespace pipeline;

Config edit_config(const HeldOutAsset& asset, const EditSettings& settings) {
  Config config;
  config.asset = asset.path;
  config.model = settings.model;
  config.orbit.num_views = settings.num_views;
  config.orbit.resolution = settings.resolution;
  config.detail.num_steps = settings.num_steps;
  config.detail.guidance_scale = settings.guidance_scale;
  config.detail.negative_prompt = settings.negative_prompt;
  config.detail.fine_detail = settings.fine_detail;
  config.turntable_frames = 0;
  config.num_threads = settings.num_threads;
  return config;
}

AssetEditor::AssetEditor(const HeldOutAsset& asset, const EditSettings& settings, const fs::path& folder,
                         std::optional<diffusion::Model>& model)
    : config_(edit_config(asset, settings)),
      folder_(folder / asset.name),
      model_(model),
      bench_(open_workbench(config_, {})) {
  RunFolder run(folder_ / "views");
  views_ = render_stage(bench_, config_, run, {});
  for (const views::View& view : views_.set.views) {
    Image coverage(view.gbuffer.width, view.gbuffer.height, 1);
    coverage.pixels = view.gbuffer.coverage;
    coverage_.push_back(std::move(coverage));
  }
}

std::vector<Image> AssetEditor::edited(const std::string& name, const std::string& prompt) const {
  Config config = config_;
  config.detail.prompt = prompt;
  RunFolder run(folder_ / name);
  return detail_stage(bench_, views_, config, run, {}, &model_);
}

}  // namespace patina::bench
