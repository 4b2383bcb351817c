// The list of configurations that an ablation compares.
#include <algorithm>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/pipeline/ablate.h"

namespace patina::pipeline {

using diffusion::BiasScaling;

std::vector<AblationStep> ablation_steps(const Config& config, const AblationOptions& options,
                                         const std::filesystem::path& folder) {
  if (config.edit.options.tile_scale == 0)
    throw Error(ErrorCode::kUsage, "tile-scale",
                "expected more than 0: the baseline leaves ControlNet tile out, the next step adds it");
  Config current = config;
  current.output.clear();
  current.report.turntable_frames = 0;
  if (!options.view_counts.empty()) current.inputs.orbit.num_views = options.view_counts.front();

  std::vector<AblationStep> steps;
  const auto add = [&](const std::string& name, const std::string& title, const std::string& note) {
    for (const AblationStep& step : steps)
      if (step.name == name)
        throw Error(ErrorCode::kUsage, "weights", fmt::format("the step {} is asked for twice", name));
    current.run = folder / "steps" / name;
    steps.push_back({name, title, note, current});
  };

  current.edit.options.tile_scale = 0;
  current.edit.options.bias_weight = 0;
  current.edit.noise = correspond::NoiseMode::kIndependent;
  add("baseline", "Baseline", "views in one grid, independent noise");
  current.edit.options.tile_scale = config.edit.options.tile_scale;
  add("tile", "+ ControlNet tile", fmt::format("scale {}", current.edit.options.tile_scale));
  current.edit.noise = correspond::NoiseMode::kPaper;
  if (options.noise_paper) add("noise-paper", "+ noise (paper)", "on the surface, 4 × 4 point samples");
  current.edit.noise = correspond::NoiseMode::kExact;
  add("noise-exact", "+ noise (exact)", "on the surface, whole footprints");
  for (const BiasScaling scaling : options.scalings)
    for (const float weight : options.weights) {
      if (weight == 0)
        throw Error(ErrorCode::kUsage, "weights", "0 is no bias, which is the step noise-exact");
      const bool paper = scaling == BiasScaling::kPaper;
      current.edit.options.bias_weight = weight;
      current.edit.options.bias_scaling = scaling;
      add(fmt::format("bias-{}{}", weight, paper ? "-paper" : ""), "+ attention bias",
          fmt::format("w = {}{}", weight, paper ? ", scaled with the scores" : ""));
    }
  return steps;
}

}  // namespace patina::pipeline
