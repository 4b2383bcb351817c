// Triangles drawn into a texture: which texels a material's surface uses and which of its points they show,
// and how values go on beyond them.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "patina/asset/material_maps.h"

namespace patina::asset {

/// A texel that a triangle touches, and the point of the triangle that it shows: the one nearest to its
/// centre.
struct TouchedTexel {
  size_t texel = 0;  // y · width + x
  const Primitive* primitive = nullptr;
  uint32_t primitive_index = 0;  // among those given
  uint32_t triangle = 0;
  uvec3 corner{0};         // vertices of the triangle
  vec3 barycentric{0.0f};  // weights of the three, not negative, sum 1
  bool inside = false;     // whether the texel's centre lies in the triangle, not half a texel beside it

  template <class T>
  T interpolated(const std::vector<T>& of_vertices) const {
    return barycentric.x * of_vertices[corner.x] + barycentric.y * of_vertices[corner.y] +
           barycentric.z * of_vertices[corner.z];
  }
};

/// Calls `visit` for the texels that triangles of `material` touch in a texture of the size and layout of
/// `map` (its values are not read). Of several triangles that share a texel, each.
void each_touched_texel(std::span<const Primitive* const> primitives, const Map& map, int material,
                        const std::function<void(const TouchedTexel&)>& visit);

/// `map`'s layout with width × height texels of one channel, all zero: only size and wrap modes matter to a
/// look-up.
Map blank_map(const Map& map, int width, int height);

/// Values of texels where `valid` [h,w,1] is not positive, filled from the neighbours that have one, ring by
/// ring up to `radius` texels; farther ones become zero. Wraps as the map does.
Image dilated(const Map& map, const Image& valid, int radius);

}  // namespace patina::asset
