// How much of the possible correlation the noise of two views reaches.
#pragma once

#include <span>

#include "patina/correspond/noise.h"
#include "patina/correspond/shared_patches.h"

namespace patina::correspond {

/// Means over pairs of latent pixels of two views that see the same patch.
struct NoiseAgreement {
  double correlation = 0;  // E[n₁ n₂], over channels too
  double bound = 0;  // √(c₁ c₂) · overlap / √(A₁ A₂): what two windows onto one white field can have at most
  int64_t num_pairs = 0;
};

/// Over `patches` of views `from` and `to` of the grid. Several `noises` of one kind and different seeds make
/// the estimate sharper: the correlation's deviation is about 1/√(4 · pairs · noises).
NoiseAgreement noise_agreement(std::span<const SharedPatch> patches, std::span<const NoiseField> noises,
                               int grid, int from, int to);

/// The same, with the patches found by samples_per_side² rays a latent pixel.
NoiseAgreement noise_agreement(const render::Scene& scene, std::span<const render::Camera> cameras,
                               int latent_scale, std::span<const NoiseField> noises, int from, int to,
                               int samples_per_side = 8);

}  // namespace patina::correspond
