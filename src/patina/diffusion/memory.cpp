// How much memory a run will take. Weights are counted; activations follow from the widths of the networks
// and constants that were fitted to measurements (docs/performance.md).
#include <algorithm>
#include <cmath>

#include "patina/diffusion/edit_run.h"

namespace patina::diffusion {
namespace {

/// At its peak, on the way up at the finest level, the U-Net holds so many times its finest feature map: what
/// the way down and the ControlNets left, and a layer's input, output and scratch. Both prompts of guidance
/// one after the other take hardly less than at once: what the second will read waits, and freed maps below
/// malloc's largest threshold (32 MB) leave holes.
constexpr double kUNetMaps = 24, kGuidedMaps = 48, kGuidedInTurnMaps = 45;
/// The VAE in its last convolutions, in feature maps of its finest level: an estimate, since the U-Net was
/// the larger in every run that was measured.
constexpr double kVaeMaps = 4;
/// LibTorch's libraries and what the allocator keeps.
constexpr int64_t kLibraryBytes = 350'000'000;
constexpr double kKeptFromConverting = 0.03;  // of the weights' bytes

}  // namespace

EditMemory predict_memory(const Model& model, int grid, int view_width, int view_height,
                          const EditOptions& options) {
  const Model::State& networks = model.state();
  const int64_t bytes = networks.dtype == Dtype::kF32 ? 4 : 2;
  const auto bytes_of = [&](const auto& held) {
    return held.is_resident() ? held.use()->num_bytes() : held.num_parameters() * bytes;
  };
  // Of networks that are read anew for each use one is in memory at a time.
  int64_t sum = 0, largest = 0;
  const auto add = [&](const auto& held) {
    sum += bytes_of(held);
    largest = std::max(largest, bytes_of(held));
  };
  for (const TextStage& text : networks.texts) add(text.encoder);
  for (const Held<ControlNet>& controlnet : networks.controlnets) add(controlnet);
  add(networks.vae);
  EditMemory memory;
  const int64_t weights = networks.unet.num_bytes() + (networks.vae.is_resident() ? sum : largest);
  memory.weights =
      kLibraryBytes + weights + static_cast<int64_t>(kKeptFromConverting * static_cast<double>(weights));

  const double pixels = static_cast<double>(view_width) * view_height, views = grid * grid;
  const double latents = views * pixels / (model.latent_scale() * model.latent_scale());
  const bool guided = guidance_of(model, options).scale != 1;
  const double maps = !guided                                                             ? kUNetMaps
                      : guides_in_one_batch(networks.unet.config(), std::lround(latents)) ? kGuidedMaps
                                                                                          : kGuidedInTurnMaps;
  const double unet =
      maps * static_cast<double>(networks.unet.config().levels.front().channels * bytes) * latents;
  const double decoder =
      kVaeMaps * static_cast<double>(networks.vae.config().block_out_channels.front() * bytes) * pixels;
  memory.activations = static_cast<int64_t>(std::max(unet, decoder));
  return memory;
}

}  // namespace patina::diffusion
