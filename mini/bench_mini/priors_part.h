// What the priors add with this model: the ablation's steps and the sweep of the bias, as `patina ablate`
// measures them, over all assets.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include <nlohmann/json.hpp>

#include "edits.h"

namespace patina::bench {

/// Baseline grid, + ControlNet tile, + exact noise, + attention bias at the default w; textures are fitted at
/// every step. Lists are over the four steps, means over assets; everything of every asset lies beside them.
nlohmann::json measure_steps(std::span<const HeldOutAsset> assets, const EditSettings& settings,
                             const std::filesystem::path& folder);

/// Edits alone, for every w and both scalings. Uses the edits that measure_steps left in `folder`.
nlohmann::json measure_sweep(std::span<const HeldOutAsset> assets, const EditSettings& settings,
                             std::span<const float> weights, const std::filesystem::path& folder);

}  // namespace patina::bench
