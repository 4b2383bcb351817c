// Where in a pixel the views see which surface, and the samples of the light cache that follow from it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "patina/inverse/light_cache.h"
#include "patina/inverse/material_point.h"

namespace patina::inverse {

/// A point at which the camera ray through one place of a pixel's 2 × 2 pattern meets a surface.
struct SeenPoint {
  MaterialPoint point;
  vec3 emission{0.0f};             // W/m²/sr
  float weight = 0;                // its share of the pixel's weight
  uint32_t pixel = 0, sample = 0;  // of the light cache
};

/// Of all pixels, pixel by pixel; `sample` is not set yet.
std::vector<SeenPoint> trace_seen_points(const render::Scene& scene, const views::ViewSet& views,
                                         std::span<const CachePixel> pixels);

/// Fills `cache`'s samples: points of a pixel that show alike materials and directions make one. `base_maps`:
/// the starting maps of the asset's materials. Sorts a pixel's points by the sample that they belong to.
void make_samples(LightCache& cache, const render::Scene& scene,
                  std::span<const asset::MaterialMaps> base_maps, std::vector<SeenPoint>& points);

}  // namespace patina::inverse
