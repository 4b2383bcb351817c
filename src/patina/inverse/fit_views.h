// The views during a fit: what the light cache shows of them, where they lie, how near they have come.
#pragma once

#include <span>
#include <vector>

#include "patina/inverse/fit_state.h"
#include "patina/inverse/light_cache.h"

namespace patina::inverse {

/// The views, sRGB [H,W,3], of which `pixels` have `radiance`; black elsewhere. `gain` = 2^exposure_ev.
std::vector<Image> rendered_views(std::span<const vec3> radiance, std::span<const CachePixel> pixels,
                                  std::span<const Image> edited, float gain);

/// Gives the pixels of `cache` factors with which it shows the `clean` views, sRGB [H,W,3], where its samples
/// have the radiance `of_samples`: what it does wrong at the start it then does wrong alike afterwards, and a
/// view that was not edited changes nothing. Takes weight from pixels that it shows wrongly: what an edit
/// makes of them tells little.
void calibrate(LightCache& cache, std::span<const vec3> of_samples, std::span<const Image> clean, float gain);

/// Whether the views are moved before `iteration`.
bool is_aligned_at(int iteration, int iterations);
/// Moves every view toward what is `rendered` of it.
void align(std::vector<Image>& displacements, std::span<const Image> rendered, std::span<const Image> edited,
           std::span<const Image> weights);
/// Gives the pixels the colours of the views where they now lie.
void retarget(std::vector<CachePixel>& pixels, std::span<const Image> edited,
              std::span<const Image> displacements);

/// PSNR in dB of `radiance` against the pixels' targets, sRGB.
float psnr_of(std::span<const CachePixel> pixels, std::span<const vec3> radiance, float gain);

}  // namespace patina::inverse
