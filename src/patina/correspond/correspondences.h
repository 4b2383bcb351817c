// Which latent pixels of different views see the same surface point [Hadadan2025, Sec. 4.3], as the attention
// bias needs it.
#pragma once

#include <span>
#include <vector>

#include "patina/attention/attention.h"
#include "patina/base/progress.h"
#include "patina/render/scene.h"

namespace patina::correspond {

/// For one self-attention resolution: where each latent pixel's surface point lands in every other view.
struct Correspondences {
  int grid = 0;                         // views a side
  int view_width = 0, view_height = 0;  // latent pixels of one view
  /// landing [num_views, N]: continuous latent coordinates inside view v of the point seen by latent pixel j
  /// (row-major over the whole grid); NaN where j shows no enhanced surface, v is j's own view, or v does not
  /// see the point. Of a double-sided sheet v may see the other side: both sides have the same texture.
  std::vector<vec2> landing;
};

/// latent_pixels_per_image_pixel as a divisor: 8, 16, 32, 64 at levels 1 to 4. A view whose size does not
/// divide is covered by ceil(size / divisor) latent pixels, as the U-Net's strided convolutions make it.
Correspondences find_correspondences(const render::Scene& scene, std::span<const render::Camera> cameras,
                                     int divisor, const Progress& progress = {});

/// The keys of query i are the latent pixels j whose landing point falls into the (2r+1)² window around i,
/// i.e. the buckets of the cells in that window. Radius r = 4, 2, 1, 0 at levels 1 to 4.
attention::KeyBuckets bucket_keys(const Correspondences& correspondences, int window_radius);

/// Buckets of the four levels, finest first: divisors latent_scale × 1, 2, 4, 8 (8 to 64 for Stable
/// Diffusion), radii 4, 2, 1, 0. The U-Net halves the whole grid, rounding up; a level fits it if views are
/// multiples of latent_scale × 8 pixels.
std::vector<attention::KeyBuckets> bias_levels(const render::Scene& scene,
                                               std::span<const render::Camera> cameras,
                                               const Progress& progress = {}, int latent_scale = 8);

}  // namespace patina::correspond
