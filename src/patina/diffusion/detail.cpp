// Image-to-image over a grid of views. The VAE works view by view, since its activations are the largest of
// all; the U-Net and the ControlNets see the whole grid, so that their self-attention crosses views.
#include "patina/diffusion/detail.h"

#include <cmath>
#include <limits>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/base/error.h"
#include "patina/base/random.h"
#include "patina/diffusion/model.h"
#include "patina/diffusion/sampler.h"

namespace patina::diffusion {
namespace {

/// Sizes of a run, in pixels and latent pixels.
struct Sizes {
  int64_t grid = 1;
  int64_t view_height = 0, view_width = 0;      // pixels of one view
  int64_t latent_height = 0, latent_width = 0;  // latent pixels of one view
};

[[noreturn]] void usage(const std::string& where, const std::string& message) {
  throw Error(ErrorCode::kUsage, where, message);
}

std::string size_text(int64_t width, int64_t height) {
  return std::to_string(width) + " × " + std::to_string(height);
}

void check_views(const std::vector<Image>& views, const char* name, const Sizes& sizes) {
  const auto expected = static_cast<size_t>(sizes.grid * sizes.grid);
  if (views.size() != expected) {
    usage(name, "there are " + std::to_string(views.size()) + " images, expected " +
                    std::to_string(expected) + " for a grid of " + size_text(sizes.grid, sizes.grid));
  }
  for (const Image& view : views) {
    if (view.width != sizes.view_width || view.height != sizes.view_height || view.channels != 3) {
      usage(name, "an image is " + size_text(view.width, view.height) + " with " +
                      std::to_string(view.channels) + " channels, expected " +
                      size_text(sizes.view_width, sizes.view_height) + " with 3");
    }
  }
}

/// The biased levels must be the U-Net's own resolutions: each is half the last, rounded up as its strided
/// convolutions do.
void check_bias(const std::vector<attention::KeyBuckets>& levels, const Sizes& sizes, size_t num_levels) {
  for (const attention::KeyBuckets& buckets : levels) {
    attention::validate(buckets);
    int64_t width = sizes.grid * sizes.latent_width, height = sizes.grid * sizes.latent_height;
    bool found = false;
    for (size_t i = 0; i < num_levels; ++i) {
      found = found || (buckets.width() == width && buckets.height() == height);
      width = (width + 1) / 2, height = (height + 1) / 2;
    }
    if (!found) {
      usage("bias", "a level is made for " + size_text(buckets.width(), buckets.height()) +
                        " latent pixels, which is no resolution of the "
                        "U-Net for a grid of " +
                        size_text(sizes.grid * sizes.latent_width, sizes.grid * sizes.latent_height) +
                        " latent pixels; views whose size is a multiple of 64 pixels always fit");
    }
  }
}

Sizes checked_sizes(const Model& model, const DetailInputs& inputs, const DetailOptions& options) {
  if (inputs.grid < 1) usage("grid", "is " + std::to_string(inputs.grid) + ", expected at least 1");
  if (inputs.tile_views.empty()) usage("tile views", "there are none");
  const int64_t scale = model.latent_scale();
  const Image& first = inputs.tile_views.front();
  const Sizes sizes{inputs.grid, first.height, first.width, first.height / scale, first.width / scale};
  if (first.width <= 0 || first.height <= 0 || first.width % scale || first.height % scale) {
    usage("tile views", "are " + size_text(first.width, first.height) + " pixels; expected multiples of " +
                            std::to_string(scale));
  }
  check_views(inputs.tile_views, "tile views", sizes);
  check_views(inputs.normal_views, "normal views", sizes);
  if (!inputs.start_views.empty()) check_views(inputs.start_views, "start views", sizes);
  const int64_t noise_size =
      model.latent_channels() * sizes.grid * sizes.grid * sizes.latent_height * sizes.latent_width;
  if (static_cast<int64_t>(inputs.noise.size()) != noise_size) {
    usage("noise",
          "has " + std::to_string(inputs.noise.size()) + " values, expected " + std::to_string(noise_size));
  }
  const auto in_range = [](const char* name, double value, double low, double high) {
    if (!(value >= low && value <= high)) {
      usage(name, "is " + std::to_string(value) + ", expected " + std::to_string(low) + " to " +
                      std::to_string(high));
    }
  };
  in_range("steps", options.num_steps, 1, 1000);
  in_range("guidance scale", options.guidance_scale, 0, 100);
  in_range("strength", options.strength, 0, 1);
  in_range("tile scale", options.tile_scale, 0, 10);
  in_range("normal scale", options.normal_scale, 0, 10);
  in_range("bias", options.bias_weight, -1000, 1000);
  check_bias(inputs.bias_levels, sizes, model.state().unet.config().levels.size());
  return sizes;
}

/// [1,3,H,W] f32 from an image, values as they are.
at::Tensor tensor_from_image(const Image& image) {
  const at::Tensor pixels = at::from_blob(const_cast<float*>(image.pixels.data()),
                                          {1, image.height, image.width, image.channels}, at::kFloat);
  return pixels.permute({0, 3, 1, 2}).clone();
}

Image image_from_tensor(const at::Tensor& tensor) {
  const at::Tensor pixels = tensor.permute({0, 2, 3, 1}).contiguous();
  Image image(static_cast<int>(pixels.size(2)), static_cast<int>(pixels.size(1)),
              static_cast<int>(pixels.size(3)));
  std::copy_n(pixels.data_ptr<float>(), image.pixels.size(), image.pixels.begin());
  return image;
}

/// grid² tensors [1,C,h,w], row by row -> [1,C,grid·h,grid·w].
at::Tensor tile(const std::vector<at::Tensor>& views, int64_t grid) {
  std::vector<at::Tensor> rows;
  for (int64_t row = 0; row < grid; ++row) {
    const auto begin = views.begin() + row * grid;
    rows.push_back(at::cat(std::vector<at::Tensor>(begin, begin + grid), 3));
  }
  return at::cat(rows, 2);
}

/// The whole grid's condition image through a ControlNet's embedding.
at::Tensor grid_hint(const ControlNet& network, const std::vector<Image>& views, int64_t grid) {
  std::vector<at::Tensor> tensors;
  for (const Image& view : views) tensors.push_back(tensor_from_image(view));
  return network.hint(tile(tensors, grid));
}

/// Posterior means of the start images, scaled to unit variance, as one grid [C,H,W].
std::vector<float> start_latents(const Vae& vae, const std::vector<Image>& views, int64_t grid,
                                 const Progress& progress) {
  std::vector<at::Tensor> latents;
  for (const Image& view : views) {
    progress.throw_if_stopped();
    latents.push_back(vae.encode(2 * tensor_from_image(view) - 1).mean * vae.config().scaling_factor);
    progress.update("encode", static_cast<double>(latents.size()), static_cast<double>(views.size()));
  }
  const at::Tensor tiled = tile(latents, grid).contiguous();
  return {tiled.data_ptr<float>(), tiled.data_ptr<float>() + tiled.numel()};
}

/// sRGB views in [0,1] from the grid's latents.
std::vector<Image> decode_views(const Vae& vae, std::vector<float>& latents, const Sizes& sizes,
                                const Progress& progress) {
  const int64_t channels = vae.config().latent_channels, height = sizes.latent_height,
                width = sizes.latent_width;
  const at::Tensor grid =
      at::from_blob(latents.data(), {1, channels, sizes.grid * height, sizes.grid * width}, at::kFloat) /
      vae.config().scaling_factor;
  std::vector<Image> views;
  for (int64_t row = 0; row < sizes.grid; ++row) {
    for (int64_t column = 0; column < sizes.grid; ++column) {
      progress.throw_if_stopped();
      const at::Tensor view =
          grid.slice(2, row * height, (row + 1) * height).slice(3, column * width, (column + 1) * width);
      views.push_back(image_from_tensor(at::clamp(vae.decode(view) * 0.5 + 0.5, 0, 1)));
      progress.update("decode", static_cast<double>(views.size()),
                      static_cast<double>(sizes.grid * sizes.grid));
    }
  }
  return views;
}

/// Noise of ancestral schedulers: a value depends on (seed, call, place) alone, so that a resumed run draws
/// the same.
std::vector<float> scheduler_noise(uint64_t seed, int call, size_t size) {
  std::vector<float> noise(size);
  for (size_t i = 0; i < size; i += 4) {
    const std::array<float, 4> four =
        gaussian4(seed, RandomPurpose::kSchedulerNoise, i / 4, static_cast<uint32_t>(call));
    std::copy_n(four.begin(), std::min<size_t>(4, size - i), noise.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return noise;
}

}  // namespace

std::vector<Image> generate_detail(const Model& model, const DetailInputs& inputs,
                                   const DetailOptions& options, const DetailHooks& hooks,
                                   const Progress& progress) {
  const Sizes sizes = checked_sizes(model, inputs, options);
  const Model::State& networks = model.state();
  const c10::InferenceMode inference;

  const SchedulePlan plan =
      make_schedule(choose_scheduler(networks.scheduler, options.scheduler), options.num_steps);
  const int start = start_index(plan, options.strength);

  // What stays the same over all steps.
  const nn::SelfAttentionBias bias{inputs.bias_levels, options.bias_weight,
                                   options.bias_scaling == BiasScaling::kPaper};
  at::Tensor text = encode_text(networks.tokenizer, networks.text_encoder, options.prompt);
  if (options.guidance_scale != 1) {
    text = at::cat({encode_text(networks.tokenizer, networks.text_encoder, options.negative_prompt), text});
  }
  const Denoiser denoiser{
      &networks.unet,
      {{&networks.controlnet_tile, grid_hint(networks.controlnet_tile, inputs.tile_views, sizes.grid),
        options.tile_scale},
       {&networks.controlnet_normal, grid_hint(networks.controlnet_normal, inputs.normal_views, sizes.grid),
        options.normal_scale}},
      text,
      options.guidance_scale,
      &bias};

  // The start: the images at the noise level of the first step [Meng2022], or where an earlier run stood.
  SamplerState state;
  if (hooks.resume) {
    state = sampler_state_from_bytes(hooks.resume->bytes);
    if (state.latents.size() != inputs.noise.size() || state.next_call < start ||
        state.next_call > plan.num_calls()) {
      throw Error(ErrorCode::kFormat, "checkpoint",
                  "belongs to a run with other sizes or steps; start the stage again");
    }
  } else {
    const std::vector<Image>& start_views =
        inputs.start_views.empty() ? inputs.tile_views : inputs.start_views;
    state.next_call = start;
    state.latents =
        add_noise(plan, start, start_latents(networks.vae, start_views, sizes.grid, progress), inputs.noise);
  }

  const auto report = [&](int next_call) {
    progress.update("detail", next_call - start, plan.num_calls() - start);
  };
  report(state.next_call);
  progress.throw_if_stopped();
  const SamplerCallbacks callbacks{
      [&](int call, size_t size) { return scheduler_noise(options.seed, call, size); },
      [&](const SamplerState& after, const Guided&) {
        if (hooks.on_checkpoint) hooks.on_checkpoint({after.next_call, to_bytes(after)});
        report(after.next_call);
        progress.throw_if_stopped();
      }};
  const int64_t shape[] = {1, networks.vae.config().latent_channels, sizes.grid * sizes.latent_height,
                           sizes.grid * sizes.latent_width};
  std::vector<float> latents = sample(denoiser, plan, std::move(state), shape, callbacks);
  for (const float value : latents) {
    if (!std::isfinite(value)) {
      throw Error(ErrorCode::kFormat, "model",
                  "gave latents that are no numbers; its weights are damaged or overflow in this precision "
                  "(try f32)");
    }
  }
  return decode_views(networks.vae, latents, sizes, progress);
}

}  // namespace patina::diffusion
