// Texels of a map beyond its border.
#pragma once

#include <cstdint>

#include "patina/asset/asset.h"

namespace patina::asset {

/// The texel that stands in for texel `i` of an axis of `size` texels; `i` may lie outside of the axis.
int texel_index(int64_t i, int size, Wrap wrap);

}  // namespace patina::asset
