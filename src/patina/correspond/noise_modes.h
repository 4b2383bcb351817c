// The three ways to fill one view with noise, as noise.cpp calls them. Values are [4, height, width] of one
// view.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "patina/correspond/footprint.h"
#include "patina/correspond/noise.h"
#include "patina/correspond/surface_field.h"

namespace patina::correspond {

inline constexpr int kNoiseChannels = 4;

/// One latent pixel of a view before it is made whole: a value of unit variance from the surface, and the
/// share of the variance that it may take; the rest is independent noise.
struct SurfaceNoise {
  std::array<float, kNoiseChannels> value{};
  float share = 0;  // [0,1]
};

/// [height · width] of one view, from the points of `field` that the view sees.
std::vector<SurfaceNoise> surface_noise_exact(const render::Scene& scene, const render::Camera& camera,
                                              const Footprints& footprints, const SurfaceField& field,
                                              uint64_t seed);

/// [height · width] of one view, from 4 × 4 point samples of a field in UV space.
std::vector<SurfaceNoise> surface_noise_paper(const render::Scene& scene, const render::Camera& camera,
                                              int latent_scale, int field_size, uint64_t seed);

/// The field whose points fall about kPointsPerLatent to a latent pixel of median size.
SurfaceField make_surface_field(const render::Scene& scene, std::span<const Footprints> footprints);

}  // namespace patina::correspond
