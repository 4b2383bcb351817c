// Image-to-image over a grid of views. The VAE works view by view, since its activations are the largest of
// all; the U-Net and the ControlNets see the whole grid, so that their self-attention crosses views.
#include "patina/diffusion/edit.h"

#include <algorithm>
#include <cmath>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/base/error.h"
#include "patina/diffusion/edit_run.h"
#include "patina/diffusion/fine_detail.h"

namespace patina::diffusion {
namespace {

/// sRGB views in [0,1] from the grid's latents, and `share` of what the VAE loses of the renders.
std::vector<Image> decode_views(const Vae& vae, std::vector<float>& latents, const GridSizes& sizes,
                                const std::vector<Image>& renders, float share, const Progress& progress) {
  const int64_t channels = vae.config().latent_channels, height = sizes.latent_height,
                width = sizes.latent_width;
  const at::Tensor grid =
      at::from_blob(latents.data(), {1, channels, sizes.grid * height, sizes.grid * width}, at::kFloat) /
      vae.config().scaling_factor;
  std::vector<Image> views;
  for (int64_t row = 0; row < sizes.grid; ++row) {
    for (int64_t column = 0; column < sizes.grid; ++column) {
      progress.throw_if_stopped();
      at::Tensor view = 0.5 * vae.decode(grid.slice(2, row * height, (row + 1) * height)
                                             .slice(3, column * width, (column + 1) * width))
                                  .cpu() +
                        0.5;
      if (share > 0) view = view + share * fine_detail(vae, tensor_from_image(renders[views.size()]), view);
      views.push_back(image_from_tensor(at::clamp(view, 0, 1)));
      progress.update("decode", static_cast<double>(views.size()),
                      static_cast<double>(sizes.grid * sizes.grid));
    }
  }
  return views;
}

}  // namespace

std::vector<Image> edit_views(const Model& model, const EditInputs& inputs, const EditOptions& options,
                              const EditHooks& hooks, const Progress& progress) {
  const c10::InferenceMode inference;
  const std::unique_ptr<EditRun> run = start_edit(model, inputs, options, hooks.resume, progress);

  const auto report = [&](int next_call) {
    progress.update("detail", next_call - run->start, run->plan.num_calls() - run->start);
  };
  report(run->state.next_call);
  progress.throw_if_stopped();
  SamplerCallbacks callbacks{[&](int call, size_t size) { return scheduler_noise(options.seed, call, size); },
                             [&](const SamplerState& after, const Guided&) {
                               if (hooks.on_checkpoint)
                                 hooks.on_checkpoint({after.next_call, to_bytes(after)});
                               report(after.next_call);
                               progress.throw_if_stopped();
                             }};
  if (run->late) callbacks.late = &*run->late;
  std::vector<float> latents = sample(run->denoiser, run->plan, std::move(run->state), run->shape, callbacks);
  for (const float value : latents) {
    if (!std::isfinite(value)) {
      throw Error(ErrorCode::kFormat, "model",
                  "gave latents that are no numbers; its weights are damaged or overflow in this precision "
                  "(try f32)");
    }
  }
  return decode_views(*model.state().vae.use(), latents, run->sizes, inputs.tile_views,
                      options.fine_detail * std::min(options.tile_scale, 1.0f), progress);
}

}  // namespace patina::diffusion
