// The one source of the benchmark that sees the networks.
#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/diffusion/model.h"
#include "vae_part.h"

namespace patina::bench {

Image vae_round_trip(const diffusion::Model& model, const Image& srgb) {
  const c10::InferenceMode no_gradients;
  const std::shared_ptr<const diffusion::Vae> vae = model.state().vae.use();
  const at::Tensor picture =
      at::from_blob(const_cast<float*>(srgb.pixels.data()), {1, srgb.height, srgb.width, 3}, at::kFloat)
          .permute({0, 3, 1, 2})
          .contiguous();
  const at::Tensor back = vae->decode(vae->encode(2 * picture - 1).mean);
  const at::Tensor hwc = (0.5 * back + 0.5).clamp(0, 1).to(at::kFloat).permute({0, 2, 3, 1}).contiguous();
  Image out(srgb.width, srgb.height, 3);
  std::copy_n(hwc.data_ptr<float>(), out.pixels.size(), out.pixels.begin());
  return out;
}

}  // namespace patina::bench
