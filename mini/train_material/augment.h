// How edits by diffusion differ from renders: blur, compression, noise, drifting colours, a shift by a pixel.
// And how one sample stands for others: cuts, mirror images, exchanged colour channels, other exposures.
#pragma once

#include <cstdint>
#include <random>

#include <ATen/core/Tensor.h>

#include "records.h"

namespace patina::train_material {

/// `count` cuts [B,kNumPlanes,side,side] of random samples: half of them parts of a view at its own size,
/// half whole views at the size of the cut; mirrored or with exchanged colour channels now and then, all
/// planes alike.
at::Tensor random_cuts(const Records& records, int64_t count, int64_t side, std::mt19937_64& random);

/// `planes` [B,kNumPlanes,H,W] with both pictures under another exposure and the edited one disturbed: each
/// sample by some of the disturbances, one in six by none. Sides are multiples of 8. Draws on LibTorch's
/// generator.
at::Tensor disturbed(const at::Tensor& planes);

/// The steps of disturbed(), for tests. `strength` [B,1,1,1], 0: unchanged.
at::Tensor blurred(const at::Tensor& picture, const at::Tensor& sigma);  // sigma in pixels, at most 2
at::Tensor compressed(const at::Tensor& picture,
                      const at::Tensor& strength);  // 1: about JPEG's quality of 50
at::Tensor reexposed(const at::Tensor& picture, const at::Tensor& coverage, const at::Tensor& ev);

}  // namespace patina::train_material
