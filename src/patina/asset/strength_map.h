// How strongly each place of a material may be edited: a map of one channel, 0 not at all to 1 fully. Zero is
// exact: a place whose texel is zero reads as zero, however near a texel with strength lies.
#pragma once

#include <span>

#include "patina/asset/material_maps.h"

namespace patina::asset {

/// Strength at `uv_map` (from map_uv): bilinear, and zero where the nearest texel is.
float strength_at(const Map& strength, const vec2& uv_map);

/// `strength` at another size: bilinear up, mean down; zero where all texels that it overlaps are.
Map resized_strength(const Map& strength, int width, int height);

/// Strength of the texels of a width × height texture of `material` that is laid out as `like`, [h,w,1]. The
/// texture may lie on other UVs than the strength; then a texel that several places share takes the least of
/// theirs, and one of no surface takes 1.
Image strength_of_texels(std::span<const Primitive* const> primitives, const Map& strength, const Map& like,
                         int width, int height, int material);

}  // namespace patina::asset
