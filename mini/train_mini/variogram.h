// How differently two pictures change over small steps, window by window: the grain's strength, size and
// direction, wherever its grains lie.
#pragma once

#include <cstdint>

#include <ATen/core/Tensor.h>

namespace patina::train_mini {

/// Mean square differences between pixels 1, 2 and 4 apart along rows, columns and both diagonals, and of
/// rows' differences along columns, which a weave of stripes has not; averaged over windows of `window`
/// pixels that overlap by half; of the mean of the colours, red less green and blue less yellow. pictures
/// [B,3,H,W] in [-1,1] -> [B,45,h,w].
at::Tensor variogram(const at::Tensor& pictures, int64_t window);

/// Mean |log| of the ratio of two variograms, quadratic within a factor of two so that what is right is left
/// alone. Where changes are less than a step of a byte all is flat.
at::Tensor variogram_error(const at::Tensor& drawn, const at::Tensor& wanted, int64_t window);

}  // namespace patina::train_mini
