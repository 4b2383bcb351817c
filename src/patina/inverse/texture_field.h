// The change of one map, as a sum of a coarse-to-fine pyramid of textures and of one value for each kind of
// material. Levels near the resolution of the views learn detail, coarse ones carry it over texels that no
// pixel centre met, so that no speckle is left between them; levels finer than what the views resolve do not
// exist, so the original's finest detail stays under the change. Kinds (material_kinds.h) carry what all
// texels of one look have in common.
#pragma once

#include <array>
#include <cstdint>
#include <span>
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

/// The kinds to which a texel belongs most and how much it does; their shares add up to one, or are all zero
/// where no view says anything.
struct KindShares {
  static constexpr int kNumKinds = 12;  // at most, of one material
  static constexpr size_t kPerTexel = 3;
  struct Share {
    uint16_t kind = 0;
    float share = 0;
  };
  std::vector<std::array<Share, kPerTexel>> texels;  // empty: the map does not follow kinds
};

struct TextureField {
  asset::Map delta;  // [h,w,C] composed change; the map's UV set, transform and wrap modes
  // Finest (size of delta) first, the last holds the values of the kinds [1,kNumKinds,C]; delta = the sum of
  // all, upsampled, and of each texel's kinds, times `edited`.
  std::vector<Image> levels;
  KindShares kinds;
  Image guess;   // [h,w,C] the change with which the fit began (first_guess.h); empty: none
  Image edited;  // [h,w,1] share of the change that a texel takes, 0 where nothing was edited; empty: all
};

/// A zero field of width × height texels for `map`, with levels down to about eight texels a side.
TextureField make_field(const asset::Map& map, int width, int height, int channels);

/// The change that `levels`, laid out as those of `field`, add up to.
Image composed(const TextureField& field, std::span<const Image> levels);
/// Sums the levels into delta.
void compose(TextureField& field);

/// The adjoint of compose: the gradient with respect to every level from that with respect to delta.
std::vector<Image> restrict_to_levels(const TextureField& field, Image d_delta);

}  // namespace patina::inverse
