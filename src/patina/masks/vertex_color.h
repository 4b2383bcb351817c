// A strength map from the colours that a mesh carries at its vertices.
#pragma once

#include <optional>
#include <span>

#include "patina/asset/material_maps.h"

namespace patina::masks {

/// width × height texels laid out as `like`: the mean of red, green and blue of COLOR_0, interpolated over
/// the triangles of `material`; the largest where several places share a texel, and going on a little beyond
/// the surface. Mesh parts without colours count as white. nullopt where no part of the material has colours.
std::optional<asset::Map> vertex_color_strength(std::span<const asset::Primitive* const> primitives,
                                                const asset::Map& like, int width, int height, int material);

}  // namespace patina::masks
