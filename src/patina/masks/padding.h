// How far masks that are made from the surface go on beyond it.
#pragma once

namespace patina::masks {

/// Texels: enough that a look-up beside a seam, also in coarser levels, finds no texel of no surface.
inline constexpr int kPaddingTexels = 8;

}  // namespace patina::masks
