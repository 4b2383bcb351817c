#include "patina/diffusion/fine_detail.h"

#include <ATen/ATen.h>

namespace patina::diffusion {
namespace {

/// [1,3,H,W] -> [1,1,H,W], Rec. 709's weights on values as they are.
at::Tensor luma(const at::Tensor& image) {
  return (at::tensor({0.2126f, 0.7152f, 0.0722f}).view({1, 3, 1, 1}) * image).sum(1, /*keepdim=*/true);
}

/// The largest value within 10 pixels, somewhat more than a latent pixel; single noisy pixels do not count.
at::Tensor largest_around(const at::Tensor& map) {
  const at::Tensor smooth = at::avg_pool2d(map, 5, 1, 2, /*ceil_mode=*/false, /*count_include_pad=*/false);
  return at::max_pool2d(smooth, 17, 1, 8);
}

}  // namespace

at::Tensor fine_detail(const Vae& vae, const at::Tensor& render, const at::Tensor& edited) {
  constexpr float kColourChange = 0.25f;  // of which 1/e of the colour comes back
  const at::Tensor kept = 0.5 * vae.decode(vae.encode(2 * render - 1).mean).cpu() + 0.5;
  const at::Tensor lost = render - kept, light = luma(lost), change = edited - kept;
  const at::Tensor colour_change = (change - luma(change)).square().sum(1, /*keepdim=*/true);
  const at::Tensor share = at::exp(-largest_around(colour_change) / (kColourChange * kColourChange));
  return light + share * (lost - light);
}

}  // namespace patina::diffusion
