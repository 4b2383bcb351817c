// The loss of inverse rendering and which pixels it counts: Reinhard tone mapping without clipping, relative
// L2 against the edited view, masks at silhouettes and depth edges, less weight at grazing angles
// [Hadadan2025, Sec. 5].
#pragma once

#include <vector>

#include "patina/image/image.h"
#include "patina/views/view_set.h"

namespace patina::inverse {

/// Keeps the relative error finite where render and target are black: below a tone-mapped value of 0.1 errors
/// count as absolute ones.
inline constexpr float kLossEpsilon = 0.01f;

/// Below this cosine between surface normal and view direction (60°) a pixel's weight falls linearly to zero.
inline constexpr float kGrazingCosine = 0.5f;

/// Mean over the three channels of (I−T)²/(sg(max(I,T))²+ε) for I = reinhard(gain · radiance), and its
/// derivative. The square is a product of two independent estimates of I: E[(I−T)²] of one noisy estimate
/// also holds its variance, and descending that prefers materials that render with less noise
/// [Gkioulekas2016, Sec. 5]. Departing from the paper's denominator, I² becomes max(I, T)²: a light list that
/// misses the light leaves I near zero, and its pixel would outweigh hundreds of others. With equal estimates
/// it is the plain loss, and the two derivatives add up to its derivative.
struct PixelLoss {
  float value = 0;                              // may be negative where noise exceeds error; unbiased
  vec3 d_radiance_a{0.0f}, d_radiance_b{0.0f};  // with respect to linear HDR radiance; sg(I) is held fixed
};

/// `radiance_a`, `radiance_b`: linear HDR, >= 0. `target`: tone-mapped linear in [0,1], linear_from_srgb of
/// the edited view. `gain` = 2^exposure_ev.
PixelLoss relative_l2(const vec3& radiance_a, const vec3& radiance_b, const vec3& target, float gain);

/// Pixels of the edited view as the loss wants them: linear_from_srgb, clamped to [0,1].
Image loss_target(const Image& edited);

}  // namespace patina::inverse
