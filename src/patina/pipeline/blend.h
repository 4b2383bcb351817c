// Old and new textures in one: how much of what the fit made goes into the output.
#pragma once

#include "patina/pipeline/stages.h"
#include "patina/pipeline/workbench.h"

namespace patina::pipeline {

/// The asset's own maps, of which `share` in [0,1] is replaced by the fitted ones: linear values are mixed
/// texel by texel, normals become unit vectors again. Old maps are resampled to the size of the new ones. Of
/// share 0 nothing is changed, of share 1 the fitted maps come back as they are.
FittedMaterials blended(const Workbench& bench, FittedMaterials fitted, float share);

}  // namespace patina::pipeline
