// How much memory a run will take. Weights are counted; activations follow from the widths of the networks
// and constants that were fitted to measurements (docs/performance.md).
#include <algorithm>
#include <cmath>

#include "patina/diffusion/detail_run.h"

namespace patina::diffusion {
namespace {

/// At its peak, on the way up at the finest level, the U-Net holds so many times its finest feature map: what
/// the way down and the ControlNets left, and a layer's input, output and scratch.
constexpr double kUNetMaps = 24;
/// What the ControlNets left for the second prompt of guidance while the first is evaluated, where they are
/// not one batch: in SD 1.5 its thirteen residuals.
constexpr double kWaitingMaps = 6.5;
/// The VAE in its last convolutions, in feature maps of its finest level: an estimate, since the U-Net was
/// the larger in every run that was measured.
constexpr double kVaeMaps = 4;
/// LibTorch's libraries and what the allocator keeps from converting weights.
constexpr int64_t kLibraryBytes = 350'000'000;

}  // namespace

DetailMemory predict_memory(const Model& model, int grid, int view_width, int view_height,
                            const DetailOptions& options) {
  const Model::State& networks = model.state();
  const int64_t bytes = networks.dtype == Dtype::kF32 ? 4 : 2;
  const int64_t text = networks.text_encoder.num_parameters() * bytes,
                vae = networks.vae.num_parameters() * bytes,
                tile = networks.controlnet_tile.num_parameters() * bytes,
                normal = networks.controlnet_normal.num_parameters() * bytes;
  DetailMemory memory;
  memory.weights = kLibraryBytes + networks.unet.num_parameters() * bytes;
  memory.weights +=
      networks.vae.is_resident() ? text + vae + tile + normal : std::max({text, vae, tile, normal});

  const double pixels = static_cast<double>(view_width) * view_height, views = grid * grid;
  const double latents = views * pixels / (model.latent_scale() * model.latent_scale());
  const bool guided = guidance_scale_of(options, networks.guidance) != 1;
  const double maps = !guided ? kUNetMaps
                      : guides_in_one_batch(networks.unet.config(), std::lround(latents))
                          ? 2 * kUNetMaps
                          : kUNetMaps + kWaitingMaps;
  const double unet =
      maps * static_cast<double>(networks.unet.config().levels.front().channels * bytes) * latents;
  const double decoder =
      kVaeMaps * static_cast<double>(networks.vae.config().block_out_channels.front() * bytes) * pixels;
  memory.activations = static_cast<int64_t>(std::max(unet, decoder));
  return memory;
}

}  // namespace patina::diffusion
