// What the views tell about a texture: how finely they resolve it, which texels they see, and which texels
// any surface uses.
#pragma once

#include <span>
#include <vector>

#include "patina/inverse/seen_points.h"

namespace patina::inverse {

/// Texels of `map` across one pixel, the quarter of the material's pixels that see it closest left below: 3
/// means that a texture of a third of the size loses hardly anything that the views show. 0 where no pixel
/// shows the material or it has no UVs.
float texels_per_pixel(const render::Scene& scene, const views::ViewSet& views,
                       std::span<const CachePixel> pixels, const asset::Map& map, int material);

/// Sum of weights with which the views see every texel of a width × height texture laid out as `map`.
/// [height,width,1]
Image evidence_of(const asset::Map& map, int width, int height, asset::MapSlot slot, int material,
                  std::span<const SeenPoint> points);

/// The texels of a texture that some triangle of the material touches, and where on the surface they lie; of
/// several places that share a texel, one.
struct SurfaceTexels {
  Image covered;              // [height,width,1]: 1 or 0
  std::vector<vec3> p_world;  // [height · width], metres; (0,0,0) where nothing is covered
};
/// Of a width × height texture laid out as `map`.
SurfaceTexels surface_texels(const render::Scene& scene, const asset::Map& map, int width, int height,
                             int material);

}  // namespace patina::inverse
