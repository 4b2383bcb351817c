// What each prior adds: the same edit from the same seed with one part after another switched on, compared in
// one page and one file of numbers [Hadadan2025, Fig. 7, Table 1].
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/pipeline/config.h"
#include "patina/pipeline/pick_point.h"
#include "patina/pipeline/run_progress.h"

namespace patina::pipeline {

struct AblationOptions {
  std::vector<float> weights{0.6f, 1.2f, 1.8f, 2.4f};  // w of the steps with attention bias; may be empty
  std::vector<diffusion::BiasScaling> scalings{diffusion::BiasScaling::kAdditive};  // each with every w
  /// The steps are made with the first; time and memory of the last step are measured with all. Empty: with
  /// what the configuration says.
  std::vector<int> view_counts;
  bool noise_paper = true;  // the step with the paper's own noise between "+ tile" and the exact noise
  bool fit = true;          // carry every step into textures and measure those too
  PointOptions point;       // that the crops show
};

/// One configuration of the comparison. `name` is its folder: "noise-exact", "bias-1.2", "bias-1.2-paper".
struct AblationStep {
  std::string name;
  std::string title, note;  // for people: "+ attention bias", "w = 1.2"
  Config config;            // with its run folder
};

/// baseline (independent noise, ControlNet tile off, no bias), + tile, + noise (paper), + noise (exact), +
/// bias for every scaling and w, with run folders `folder`/steps/<name>. Throws Error{kUsage} for options
/// that make two steps the same.
std::vector<AblationStep> ablation_steps(const Config& config, const AblationOptions& options,
                                         const std::filesystem::path& folder);

/// Runs all steps into `folder`, and writes ablation.html and ablation.json there. The views are rendered and
/// the model is loaded once. A step that is there from earlier is not run again; one that was killed goes on
/// where it stood. Progress counts steps: "edit steps", "fit steps", "more views". Returns ablation.json.
nlohmann::json ablate(Config config, const AblationOptions& options, const std::filesystem::path& folder,
                      const RunProgress& progress);

}  // namespace patina::pipeline
