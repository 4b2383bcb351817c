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

/// The three residuals of a pixel, (I−T) / √(3 (max(I,T)² + ε)) for I = reinhard(gain · radiance): the sum of
/// their squares is its loss, a relative error. The denominator is held fixed in derivatives. A target that
/// is clipped white says only that the pixel is at least that bright: brighter renders have no residual.
struct PixelResidual {
  vec3 value{0.0f};
  vec3 d_radiance{0.0f};  // of each channel's residual with respect to that channel's linear HDR radiance
};

/// `radiance`: linear HDR, >= 0. `target`: tone-mapped linear in [0,1], linear_from_srgb of the edited view.
/// `gain` = 2^exposure_ev.
PixelResidual relative_residual(const vec3& radiance, const vec3& target, float gain);

/// Tone-mapped linear values from here on (sRGB 250 of 255) count as clipped.
inline constexpr float kClippedTarget = 0.956f;

/// Pixels of the edited view as the loss wants them: linear_from_srgb, clamped to [0,1].
Image loss_target(const Image& edited);

/// Weight of every pixel in the loss, [H,W,1] in [0,1]: zero off the enhanced materials, within
/// `boundary_pixels` of the object's boundary and of depth edges; times the view cosine at grazing angles.
Image loss_weight(const views::GBuffer& gbuffer, const std::vector<bool>& materials, int boundary_pixels);

}  // namespace patina::inverse
