// The light cache: for a jittered point of every pixel that counts, the surface it hits and the light
// that arrives there, traced once and kept in eight bytes a direction. Geometry, cameras and lights never
// change while textures are fitted, so an iteration shades and differentiates these lists without casting a
// ray (shade.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "patina/inverse/incident_light.h"
#include "patina/inverse/material_point.h"
#include "patina/views/view_set.h"

namespace patina::inverse {

/// One incident direction, packed (light_packing.h).
struct PackedLight {
  uint32_t direction = 0;
  uint32_t radiance = 0;
};

/// What a pixel's camera ray met.
struct CacheSample {
  MaterialPoint point;
  MapValues base;       // the starting maps at the point, before any change
  vec3 emission{0.0f};  // W/m²/sr
  bool hit = false;     // false: the ray met nothing, the pixel is black
};

/// A pixel that counts in the loss.
struct CachePixel {
  uint16_t view = 0;
  uint16_t x = 0, y = 0;
  float weight = 0;   // from loss_weight
  vec3 target{0.0f};  // tone-mapped linear
};

struct LightCache {
  std::vector<CachePixel> pixels;    // view by view, rows from the top
  std::vector<CacheSample> samples;  // [pixels]
  std::vector<PackedLight> lights;   // [pixels, lights_per_pixel]
  int lights_per_pixel = 0;

  std::span<const PackedLight> lights_of(size_t pixel) const {
    const auto n = static_cast<size_t>(lights_per_pixel);
    return {lights.data() + pixel * n, n};
  }
  size_t bytes() const;
};

struct CacheOptions {
  int light_samples = 8;  // directions a pixel
  int max_depth = 4;      // path segments after the camera ray
  uint64_t seed = 0;
  uint32_t generation = 0;  // another one gives other points and directions
};

/// The pixels of all views with a positive weight. targets [H,W,3] tone-mapped linear, weights [H,W,1]; one
/// of each a view.
std::vector<CachePixel> select_pixels(const views::ViewSet& views, std::span<const Image> targets,
                                      std::span<const Image> weights);

/// Traces samples and lights of `cache`, whose pixels are given; memory that it holds is used again. The
/// asset wears `asset_materials`: directions follow them, and so does the light that its surfaces reflect.
/// `base_maps` are the starting maps from which CacheSample::base is read.
void trace_cache(LightCache& cache, const render::Scene& scene,
                 std::span<const asset::MaterialMaps> asset_materials,
                 std::span<const asset::MaterialMaps> base_maps, const views::ViewSet& views,
                 const CacheOptions& options, const Progress& progress);

}  // namespace patina::inverse
