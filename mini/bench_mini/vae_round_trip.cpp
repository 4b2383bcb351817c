// The one source of the benchmark that sees the networks.
#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "mini_data/octaves.h"
#include "patina/diffusion/edit_run.h"
#include "patina/diffusion/fine_detail.h"
#include "patina/diffusion/model_state.h"
#include "vae_part.h"

namespace patina::bench {

using diffusion::image_from_tensor, diffusion::tensor_from_image;

namespace {

at::Tensor round_trip(const diffusion::Vae& vae, const at::Tensor& picture) {
  return 0.5 * vae.decode(vae.encode(2 * picture - 1).mean).cpu() + 0.5;
}

}  // namespace

Image vae_round_trip(const diffusion::Model& model, const Image& srgb) {
  const c10::InferenceMode no_gradients;
  return image_from_tensor(round_trip(*model.state().vae.use(), tensor_from_image(srgb)).clamp(0, 1));
}

Image as_edited_view(const diffusion::Model& model, const Image& before, const Image& after) {
  const c10::InferenceMode no_gradients;
  const std::shared_ptr<const diffusion::Vae> vae = model.state().vae.use();
  const at::Tensor edited = round_trip(*vae, tensor_from_image(after));
  return image_from_tensor(
      (edited + diffusion::fine_detail(*vae, tensor_from_image(before), edited)).clamp(0, 1));
}

ObjectEnergy object_energy(const Image& srgb, const Image& coverage) {
  const c10::InferenceMode no_gradients;
  const at::Tensor inside = mini_data::windows_inside(tensor_from_image(coverage));
  const mini_data::FineEnergy energy = mini_data::fine_energy(tensor_from_image(srgb));
  const double windows = std::max(inside.sum().item<double>(), 1.0);
  return {(energy.finest * inside).sum().item<double>() / windows,
          (energy.both * inside).sum().item<double>() / windows, static_cast<int64_t>(windows)};
}

}  // namespace patina::bench
