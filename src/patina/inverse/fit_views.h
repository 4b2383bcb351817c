// The views during a fit: what the light caches show of them, where they lie, how near they have come.
#pragma once

#include <span>
#include <vector>

#include "patina/inverse/fit_state.h"
#include "patina/inverse/light_cache.h"

namespace patina::inverse {

/// The views, sRGB [H,W,3], as the caches showed them when they were last looked at: their pixels' mean
/// radiance; black elsewhere. `gain` = 2^exposure_ev.
std::vector<Image> rendered_views(const FitState& state, std::span<const CachePixel> pixels,
                                  std::span<const Image> edited, float gain);

/// Whether the views are moved before `iteration`.
bool is_aligned_at(int iteration, int iterations);
// Moves every view toward what the caches show of it.
void align(FitState& state, std::span<const CachePixel> pixels, std::span<const Image> edited,
           std::span<const Image> weights, float gain);
// Gives the pixels the colours of the views where they now lie.
void retarget(std::vector<CachePixel>& pixels, std::span<const Image> edited,
              std::span<const Image> displacements);

/// PSNR in dB of a cache's `radiance` against its pixels' targets, sRGB.
float psnr_of(const LightCache& cache, std::span<const vec3> radiance, float gain);

}  // namespace patina::inverse
