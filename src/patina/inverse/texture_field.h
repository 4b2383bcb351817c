// The change of one map, as a sum of a coarse-to-fine pyramid of textures, and its Adam state. Levels near
// the resolution of the views learn detail, coarse ones carry it over texels that no pixel centre met, so
// that no speckle is left between them; levels finer than what the views resolve do not exist, so the
// original's finest detail stays under the change.
#pragma once

#include <vector>

#include "patina/asset/material_maps.h"
#include "patina/image/image.h"

namespace patina::inverse {

/// Weights of the linear interpolation that doubles an axis: texel i of the fine axis reads coarse texels a
/// and b.
struct UpsampleTap {
  int a, b;
  float weight_b;
};

struct TextureField {
  asset::Map delta;           // [h,w,C] composed change; the map's UV set, transform and wrap modes
  std::vector<Image> levels;  // finest (size of delta) first; delta = sum of all, upsampled
  std::vector<Image> first_moment, second_moment;  // Adam, per level
  std::vector<int> num_steps;                      // Adam steps per level
};

/// A zero field of width × height texels for `map`, with levels down to about eight texels a side.
TextureField make_field(const asset::Map& map, int width, int height, int channels);

/// Sums the levels into delta.
void compose(TextureField& field);

/// The adjoint of compose: the gradient with respect to every level from that with respect to delta.
std::vector<Image> restrict_to_levels(const TextureField& field, const Image& d_delta);

struct AdamOptions {
  float learning_rate = 0.02f;
  float beta1 = 0.9f, beta2 = 0.98f;
  /// Added to √v, as a share of its root mean square over the level: texels that hardly any pixel sees then
  /// move in proportion to their gradient instead of at full speed.
  float relative_epsilon = 0.1f;
};

/// One step of Adam [Kingma2015] on levels `finest` and coarser; composes afterwards.
void adam_step(TextureField& field, const std::vector<Image>& gradients, int finest,
               const AdamOptions& options);

}  // namespace patina::inverse
