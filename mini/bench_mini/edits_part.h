// Whether edits show what was asked for and keep the rest: obedience, clean prompts, edges, the ground.
#pragma once

#include <filesystem>
#include <optional>
#include <span>

#include <nlohmann/json.hpp>

#include "discriminant.h"
#include "edits.h"

namespace patina::bench {

/// Edits every asset with the prompt of every class and its clean prompt, and judges them. Leaves edited
/// views and a sheet in `folder`. {"obedience": …, "clean": …, "structure": …}.
nlohmann::json measure_edits(std::span<const HeldOutAsset> assets, const EditSettings& settings,
                             const Discriminant& classifier, const std::filesystem::path& folder,
                             pipeline::ResolvedModel& model);

}  // namespace patina::bench
