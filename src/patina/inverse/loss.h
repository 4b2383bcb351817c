// The loss of inverse rendering and which pixels it counts: Reinhard tone mapping without clipping, relative
// L2 against the edited view, masks at silhouettes and depth edges, less weight at grazing angles
// [Hadadan2025, Sec. 5].
#pragma once

#include <vector>

#include "patina/image/image.h"
#include "patina/views/view_set.h"

namespace patina::inverse {

/// Keeps the relative error finite where the render is black: below a tone-mapped value of 0.03 errors count
/// as absolute ones.
inline constexpr float kLossEpsilon = 1e-3f;

/// Below this cosine between surface normal and view direction (60°) a pixel's weight falls linearly to zero.
inline constexpr float kGrazingCosine = 0.5f;

/// Mean over the three channels of (I−T)²/(sg(I)²+ε) for I = reinhard(gain · radiance), and its derivative.
struct PixelLoss {
  float value = 0;
  vec3 d_radiance{0};  // with respect to linear HDR radiance; sg(I) is held fixed
};

/// `radiance`: linear HDR, >= 0. `target`: tone-mapped linear in [0,1], linear_from_srgb of the edited view.
/// `gain` = 2^exposure_ev.
PixelLoss relative_l2(const vec3& radiance, const vec3& target, float gain);

/// Pixels of the edited view as the loss wants them: linear_from_srgb, clamped to [0,1].
Image loss_target(const Image& edited);

}  // namespace patina::inverse
