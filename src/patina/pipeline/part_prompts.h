// Words for single materials: which part of the picture each acts on.
#pragma once

#include <vector>

#include "patina/pipeline/stages.h"

namespace patina::pipeline {

/// Materials with the same words are one part.
struct PartPrompts {
  std::vector<diffusion::PartPrompt> prompts;  // one a part
  std::vector<int> part_of;                    // [materials of the asset]; -1: the prompt acts on it
};

/// Reads EditSettings::prompt_for and negative_prompt_for. A material whose text is empty has none. Throws
/// Error{kUsage} for a text without a material, two for one material, and materials that the asset does not
/// have or that may not change.
PartPrompts part_prompts(const Workbench& bench, const Strength& strength, const EditSettings& settings);

/// diffusion::EditInputs::part_views of the views: one [H,W,parts] each, 1 where a pixel's centre shows a
/// material of the part. Empty without parts.
std::vector<Image> part_views(const PartPrompts& parts, const views::ViewSet& views);

/// The tile views in grey, each part in a colour of its own over them: [H,W,3] sRGB.
std::vector<Image> part_pictures(std::span<const Image> part_views, std::span<const Image> tile_views);

/// What the report says of the parts: [{"materials": [names], "prompt", "negative_prompt" or null, "color":
/// "#rrggbb"}].
nlohmann::json parts_as_json(const PartPrompts& parts, const Workbench& bench);

}  // namespace patina::pipeline
