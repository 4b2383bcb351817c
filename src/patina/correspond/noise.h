// The initial latent noise of all views, integrated from one white-noise field that lives on the surface
// [Hadadan2025, Sec. 4.2].
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "patina/base/progress.h"
#include "patina/render/scene.h"

namespace patina::correspond {

enum class NoiseMode {
  kIndependent,  // white noise, no relation between views
  kPaper,        // 4 × 4 point samples of a 1024² field [Hadadan2025]
  kExact,        // every point of a field on the surface counted in the pixel where it is seen: white by
                 // construction
};

/// Noise of a whole view grid, ready for the sampler. values [4, height, width] f32, zero mean and unit
/// variance. Where a latent pixel shows no enhanced surface, or only in part, independent noise has the
/// remaining share of the variance.
struct NoiseField {
  int width = 0, height = 0;  // latent pixels of the whole grid
  std::vector<float> values;
};

struct NoiseOptions {
  NoiseMode mode = NoiseMode::kExact;
  int field_size = 1024;  // kPaper: M, texels of the field a side of the unit square of UV
  uint64_t seed = 0;
  int subpixels = 4;  // kPaper: point samples a side of a latent pixel, 1 to 64
  // kExact: points of the field in a latent pixel of median footprint; docs/noise.md compares numbers.
  float points_per_latent = 48.0f;
};

/// cameras: grid × grid views; latent_scale: image pixels a latent pixel (8 for Stable Diffusion). Each
/// view's width and height must be divisible by it. Throws Error{kUsage} for sizes and options out of range.
NoiseField make_noise(const render::Scene& scene, std::span<const render::Camera> cameras, int latent_scale,
                      const NoiseOptions& options, const Progress& progress = {});

/// The same for each of `seeds` (options.seed is not read); rays, which do not depend on the seed, are cast
/// once.
std::vector<NoiseField> make_noises(const render::Scene& scene, std::span<const render::Camera> cameras,
                                    int latent_scale, const NoiseOptions& options,
                                    std::span<const uint64_t> seeds, const Progress& progress = {});

/// Models of more than four latent channels take several fields, one after another: the seed of field `block`
/// of a run, `seed` itself for the first.
uint64_t block_seed(uint64_t seed, int block);

/// Whiteness of one view's noise [4,h,w].
struct NoiseStatistics {
  float mean = 0, variance = 0;
  float autocorrelation_x = 0, autocorrelation_y = 0;  // lag 1
  float kolmogorov_smirnov_p = 0;                      // p-value against N(0,1)
  int64_t num_values = 0;
};
/// One entry a view of the grid. With a mask [height · width] over the whole grid only its nonzero latent
/// pixels count, and only neighbours that both do; a view without any has num_values = 0 and the rest zero.
std::vector<NoiseStatistics> noise_statistics(const NoiseField& noise, int grid,
                                              std::span<const uint8_t> mask = {});

}  // namespace patina::correspond
