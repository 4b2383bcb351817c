// The loss of inverse rendering and which pixels it counts: Reinhard tone mapping without clipping, relative
// L2 against the edited view, masks at silhouettes and depth edges, less weight at grazing angles
// [Hadadan2025, Sec. 5].
#pragma once

#include <vector>

#include "patina/image/image.h"
#include "patina/views/view_set.h"

namespace patina::inverse {

/// Keeps the relative error finite where the render is black: a difference of 0.1 in tone-mapped value counts
/// 1 there.
inline constexpr float kLossEpsilon = 0.01f;

/// Below this cosine between surface normal and view direction (60°) a pixel's weight falls linearly to zero.
inline constexpr float kGrazingCosine = 0.5f;

/// Mean over the three channels of (I−T)²/(sg(I)²+ε) for I = reinhard(gain · radiance), with its derivative.
/// The square is a product of two *independent* estimates of I, because E[(I−T)²] of one noisy estimate also
/// contains its variance, and descending that would prefer materials that render with less noise
/// [Gkioulekas2016, Sec. 5].
struct PairLoss {
  float value = 0;       // may be negative for noisy pairs; unbiased
  vec3 d_radiance_a{0};  // with respect to the first estimate's radiance, linear HDR
  vec3 d_radiance_b{0};
};

/// `radiance_a`, `radiance_b`: linear HDR, >= 0. `target`: tone-mapped linear in [0,1], linear_from_srgb of
/// the edited view. `gain` = 2^exposure_ev. With a == b this is the plain loss and the two derivatives add up
/// to its derivative.
PairLoss relative_l2(const vec3& radiance_a, const vec3& radiance_b, const vec3& target, float gain);

/// Pixels of the edited view as the loss wants them: linear_from_srgb, clamped to [0,1].
Image loss_target(const Image& edited);

}  // namespace patina::inverse
