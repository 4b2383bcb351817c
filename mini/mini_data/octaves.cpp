#include "mini_data/octaves.h"

#include <ATen/ATen.h>

namespace patina::mini_data {

FineEnergy fine_energy(const at::Tensor& pictures) {
  const auto variance = [&](int64_t side) {
    const at::Tensor mean = at::avg_pool2d(pictures, side, 1);
    // Of flat windows rounding leaves a little less than zero.
    return at::clamp_min(at::avg_pool2d(pictures.square(), side, 1) - mean.square(), 0)
        .mean(1, /*keepdim=*/true);
  };
  // A window of 4 × 4 holds nine of 2 × 2.
  return {at::avg_pool2d(variance(2), 3, 1), variance(4)};
}

at::Tensor windows_inside(const at::Tensor& coverage) {
  const at::Tensor outside = (coverage < 0.999).to(at::kFloat);
  const at::Tensor near_outside = at::max_pool2d(outside, 5, 1, 2);
  return 1 - at::max_pool2d(near_outside, 4, 1);
}

}  // namespace patina::mini_data
