// Lays the islands of each material into its own unit square.
#pragma once

#include <vector>

#include "patch.h"

namespace patina::kettle {

/// Sets uv_corner and uv_scale of every patch: one scale a material, the largest at which all islands fit on
/// shelves with `padding` (in units of the square) between and around them.
void pack_islands(std::vector<Patch>& patches, double padding);

}  // namespace patina::kettle
