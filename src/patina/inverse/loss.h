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

/// Mean over the three channels of (I−T)²/(sg(I)²+ε) for I = reinhard(gain · radiance), and its derivative.
/// The square is a product of two independent estimates of I, because E[(I−T)²] of one noisy estimate also
/// holds its variance, and descending that prefers materials that render with less noise [Gkioulekas2016,
/// Sec. 5]: `radiance` is the one that is differentiated, `other` gives the second factor and, as max(I, T)
/// so that an estimate near zero cannot outweigh all others, the denominator. With other == radiance it is
/// the plain loss.
struct PixelLoss {
  float value = 0;        // may be negative where noise exceeds error; unbiased
  vec3 d_radiance{0.0f};  // linear HDR; the derivative of the whole square: both factors' when they are equal
};

/// `radiance`, `other`: linear HDR, >= 0. `target`: tone-mapped linear in [0,1], linear_from_srgb of the
/// edited view. `gain` = 2^exposure_ev.
PixelLoss relative_l2(const vec3& radiance, const vec3& other, const vec3& target, float gain);

/// Pixels of the edited view as the loss wants them: linear_from_srgb, clamped to [0,1].
Image loss_target(const Image& edited);

/// Weight of every pixel in the loss, [H,W,1] in [0,1]: zero off the enhanced materials, within
/// `boundary_pixels` of the object's boundary and of depth edges; times the view cosine at grazing angles.
Image loss_weight(const views::GBuffer& gbuffer, const std::vector<bool>& materials, int boundary_pixels);

}  // namespace patina::inverse
