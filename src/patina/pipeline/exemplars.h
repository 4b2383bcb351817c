// Pictures that the edit shall be like: photographs, textures, or the base colour of another asset.
#pragma once

#include <string>
#include <vector>

#include "patina/pipeline/stages.h"

namespace patina::pipeline {

struct Exemplar {
  Image picture;                // [H,W,3] sRGB, as the file has it
  float weight = 1;             // how much the views look at it; 1: as at all views together
  std::vector<bool> materials;  // that look at it
};

/// Reads EditSettings::exemplars: "[MATERIAL=]FILE[:WEIGHT]". Throws Error for files that are no picture, for
/// assets without a base-colour texture, and as for_material().
std::vector<Exemplar> read_exemplars(const Workbench& bench, const Strength& strength,
                                     const EditSettings& settings);

/// The exemplars as the model sees them beside `views`: the middle of each picture at a view's size.
std::vector<diffusion::EditInputs::Exemplar> exemplar_inputs(const std::vector<Exemplar>& exemplars,
                                                             const views::ViewSet& views);

}  // namespace patina::pipeline
