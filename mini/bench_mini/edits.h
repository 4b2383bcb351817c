// One asset edited with many prompts, as `patina enhance` would up to the edited views.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "held_out_assets.h"
#include "patina/pipeline/config.h"
#include "patina/pipeline/stages.h"

namespace patina::bench {

/// How every edit of the benchmark is made: the defaults of `patina enhance` but for size, steps and what is
/// asked for here.
struct EditSettings {
  diffusion::ModelPaths model;
  int num_views = 4;
  int resolution = 256;
  int num_steps = 20;
  float guidance_scale = diffusion::kAutoGuidanceScale;
  std::optional<std::string> negative_prompt = std::nullopt;
  float fine_detail = 1;
  int num_threads = 0;
};
pipeline::Config edit_config(const HeldOutAsset& asset, const EditSettings& settings);

/// Holds an asset's renders; its edits share them and the model. Views, edited and not, stay in
/// FOLDER/<asset>/views and FOLDER/<asset>/<name>, and are not made again.
class AssetEditor {
 public:
  /// `model` is loaded where it is empty and needed, and stays.
  AssetEditor(const HeldOutAsset& asset, const EditSettings& settings, const std::filesystem::path& folder,
              pipeline::ResolvedModel& model);

  const pipeline::RenderedViews& views() const { return views_; }
  /// Share of each pixel that surface which may change covers, [H,W,1] a view.
  const std::vector<Image>& coverage() const { return coverage_; }
  /// sRGB views [H,W,3].
  std::vector<Image> edited(const std::string& name, const std::string& prompt) const;

 private:
  pipeline::Config config_;
  std::filesystem::path folder_;
  pipeline::ResolvedModel& model_;
  pipeline::Workbench bench_;
  pipeline::RenderedViews views_;
  std::vector<Image> coverage_;
};

}  // namespace patina::bench
