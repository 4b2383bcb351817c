// How one view's noise comes from a white-noise field: a sparse linear map from the field's numbers to latent
// pixels, which is the same for every seed. Each mode of noise makes its own map; drawing is common.
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

/// Latent pixel p of the view, before independent noise fills up its variance, is
///   scale[p] · Σ_k weight[k] · field(index[k]),   k = first[p] .. first[p + 1] − 1.
/// With the weights as they are the modes make its variance one. share[p] is the part of the latent pixel's
/// variance that it may take; the rest is independent noise.
struct NoiseProjection {
  int width = 0, height = 0;      // latent pixels of the view
  uint32_t field = 0;             // which field of a seed: the two kinds below share no random number
  std::vector<int64_t> first{};   // [width · height + 1]
  std::vector<uint64_t> index{};  // numbers of the field
  std::vector<float> weight{};    // like index, or empty: all one
  std::vector<float> scale{};     // [width · height], 0 where nothing lands
  std::vector<float> share{};     // [width · height], [0,1]
};
inline constexpr uint32_t kSurfaceFieldId = 0, kUvFieldId = 0x80000000u;

/// From the points of `field` that the view sees: weights one, each point in one latent pixel at most.
NoiseProjection project_exact(const render::Scene& scene, const render::Camera& camera,
                              const Footprints& footprints, const SurfaceField& field);

/// From subpixels × subpixels point samples a latent pixel of a field of field_size² texels in UV space.
NoiseProjection project_paper(const render::Scene& scene, const render::Camera& camera, int latent_scale,
                              int field_size, int subpixels);

/// [height · width] values of four channels: the sums above for one seed.
std::vector<std::array<float, kNoiseChannels>> draw(const NoiseProjection& projection, uint64_t seed);

/// The field of which about `points_per_latent` points fall into a latent pixel of median footprint.
SurfaceField make_surface_field(const render::Scene& scene, std::span<const Footprints> footprints,
                                double points_per_latent);

}  // namespace patina::correspond
