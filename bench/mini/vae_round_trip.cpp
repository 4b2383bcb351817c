// The one source of the benchmark that sees the networks.
#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/diffusion/fine_detail.h"
#include "patina/diffusion/model.h"
#include "vae_part.h"

namespace patina::bench {
namespace {

// [1,3,H,W] over the image's own pixels.
at::Tensor tensor_over(const Image& srgb) {
  return at::from_blob(const_cast<float*>(srgb.pixels.data()), {1, srgb.height, srgb.width, 3}, at::kFloat)
      .permute({0, 3, 1, 2})
      .contiguous();
}

Image image_of(const at::Tensor& picture) {
  const at::Tensor hwc = picture.clamp(0, 1).to(at::kFloat)[0].permute({1, 2, 0}).contiguous();
  Image out(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), 3);
  std::copy_n(hwc.data_ptr<float>(), out.pixels.size(), out.pixels.begin());
  return out;
}

at::Tensor round_trip(const diffusion::Vae& vae, const at::Tensor& picture) {
  return 0.5 * vae.decode(vae.encode(2 * picture - 1).mean) + 0.5;
}

}  // namespace

Image vae_round_trip(const diffusion::Model& model, const Image& srgb) {
  const c10::InferenceMode no_gradients;
  return image_of(round_trip(*model.state().vae.use(), tensor_over(srgb)));
}

Image as_edited_view(const diffusion::Model& model, const Image& before, const Image& after) {
  const c10::InferenceMode no_gradients;
  const std::shared_ptr<const diffusion::Vae> vae = model.state().vae.use();
  const at::Tensor edited = round_trip(*vae, tensor_over(after));
  return image_of(edited + diffusion::fine_detail(*vae, tensor_over(before), edited));
}

}  // namespace patina::bench
