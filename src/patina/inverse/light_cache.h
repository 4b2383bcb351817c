// The light cache: for every pixel that counts, the surface that it shows and the light that arrives there,
// in a list of directions of eight bytes each. Geometry, cameras and lights never change while textures are
// fitted, so an iteration shades and differentiates these lists without casting a ray (shade.h).
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

/// A surface that a pixel shows: all of it, or where different ones meet in a pixel, its share of it. What a
/// pixel reflects is not what its mean material would: half metal, half paint is not a half-metal.
struct CacheSample {
  uint32_t pixel = 0;
  float share = 1;      // of the pixel; those of a pixel add up to one
  MaterialPoint point;  // halfway between its points, with the UVs of one of them
  MapValues base;       // mean of the starting maps over it
  vec3 emission{0.0f};  // W/m²/sr
  float extent = 0;     // how much the normal turns within it: squared radius of a disc of normals, rad²
};

/// A pixel that counts in the loss.
struct CachePixel {
  uint16_t view = 0;
  uint16_t x = 0, y = 0;
  float weight = 0;   // from loss_weight
  vec3 target{0.0f};  // tone-mapped linear
  // Factor on what the cache shows of the pixel, so that it shows the clean render at the start.
  vec3 calibration{1.0f};
};

struct LightCache {
  std::vector<CachePixel> pixels;      // view by view, rows from the top
  std::vector<CacheSample> samples;    // pixel by pixel; of a pixel that shows nothing none
  std::vector<uint32_t> first_sample;  // [pixels + 1] into samples
  std::vector<PackedLight> lights;     // [samples, lights_per_sample]
  int lights_per_sample = 0;

  std::span<const CacheSample> samples_of(size_t pixel) const {
    return std::span(samples).subspan(first_sample[pixel], first_sample[pixel + 1] - first_sample[pixel]);
  }
  std::span<const PackedLight> lights_of(size_t sample) const {
    const auto n = static_cast<size_t>(lights_per_sample);
    return {lights.data() + sample * n, n};
  }
  size_t bytes() const;
};

struct CacheOptions {
  int light_samples = 8;  // directions a trace
  int traces = 8;         // of each pixel, at different points in it
  int max_depth = 4;      // path segments after the camera ray
  uint64_t seed = 0;      // the same one gives the same points and, as far as materials allow, directions
};

/// The pixels of all views with a positive weight. targets [H,W,3] tone-mapped linear, weights [H,W,1]; one
/// of each a view.
std::vector<CachePixel> select_pixels(const views::ViewSet& views, std::span<const Image> targets,
                                      std::span<const Image> weights);

/// Fills the lights of `cache`, whose samples are given (seen_points.h). The asset wears `asset_materials`:
/// directions follow them, and so does the light that its surfaces reflect. Each sample also gets what was
/// traced for the pixels around it that show the same smooth surface, since light changes slowly along it.
void trace_light(LightCache& cache, const render::Scene& scene,
                 std::span<const asset::MaterialMaps> asset_materials, const views::ViewSet& views,
                 const CacheOptions& options, const Progress& progress);

}  // namespace patina::inverse
