// Everything before the first step: checks, text and condition images through their encoders, start latents.
#include "patina/diffusion/edit_run.h"

#include <algorithm>

#include <ATen/ATen.h>

#include "patina/base/error.h"
#include "patina/base/random.h"
#include "patina/diffusion/control_kinds.h"
#include "patina/diffusion/files/unet_blocks.h"

namespace patina::diffusion {
namespace {

[[noreturn]] void usage(const std::string& where, const std::string& message) {
  throw Error(ErrorCode::kUsage, where, message);
}

std::string size_text(int64_t width, int64_t height) {
  return std::to_string(width) + " × " + std::to_string(height);
}

void check_views(const std::vector<Image>& views, const std::string& name, const GridSizes& sizes,
                 int channels = 3) {
  const auto expected = static_cast<size_t>(sizes.grid * sizes.grid);
  if (views.size() != expected) {
    usage(name, "there are " + std::to_string(views.size()) + " images, expected " +
                    std::to_string(expected) + " for a grid of " + size_text(sizes.grid, sizes.grid));
  }
  for (const Image& view : views) {
    if (view.width != sizes.view_width || view.height != sizes.view_height || view.channels != channels) {
      usage(name, "an image is " + size_text(view.width, view.height) + " with " +
                      std::to_string(view.channels) + " channels, expected " +
                      size_text(sizes.view_width, sizes.view_height) + " with " + std::to_string(channels));
    }
  }
}

/// The biased levels must be the U-Net's own resolutions. Levels coarser than all of them are not used and
/// may be there: correspondences are made without knowing how many levels a model has.
void check_bias(const std::vector<attention::KeyBuckets>& levels, const GridSizes& sizes, size_t num_levels) {
  const std::vector<LatentSize> resolutions =
      level_sizes({sizes.grid * sizes.latent_width, sizes.grid * sizes.latent_height}, num_levels);
  for (const attention::KeyBuckets& buckets : levels) {
    attention::validate(buckets);
    if (buckets.width() < resolutions.back().width && buckets.height() < resolutions.back().height) continue;
    const LatentSize size{buckets.width(), buckets.height()};
    if (std::find(resolutions.begin(), resolutions.end(), size) == resolutions.end()) {
      usage("bias", "a level is made for " + size_text(buckets.width(), buckets.height()) +
                        " latent pixels, which is no resolution of the "
                        "U-Net for a grid of " +
                        size_text(resolutions[0].width, resolutions[0].height) +
                        " latent pixels; views whose size is a multiple of 64 pixels always fit");
    }
  }
}

GridSizes checked_sizes(const Model& model, const EditInputs& inputs, const EditOptions& options) {
  if (inputs.grid < 1) usage("grid", "is " + std::to_string(inputs.grid) + ", expected at least 1");
  if (inputs.tile_views.empty()) usage("tile views", "there are none");
  const int64_t scale = model.latent_scale();
  const Image& first = inputs.tile_views.front();
  const GridSizes sizes{inputs.grid, first.height, first.width, first.height / scale, first.width / scale};
  if (first.width <= 0 || first.height <= 0 || first.width % scale || first.height % scale) {
    usage("tile views", "are " + size_text(first.width, first.height) + " pixels; expected multiples of " +
                            std::to_string(scale));
  }
  for (const ControlKind& kind : kControlKinds)
    check_views(inputs.*kind.views, std::string(kind.name) + " views", sizes);
  if (!inputs.start_views.empty()) check_views(inputs.start_views, "start views", sizes);
  if (!inputs.strength_views.empty()) check_views(inputs.strength_views, "strength views", sizes, 1);
  for (const EditInputs::Exemplar& exemplar : inputs.exemplars) {
    if (exemplar.picture.width != sizes.view_width || exemplar.picture.height != sizes.view_height)
      usage("exemplar", "is " + size_text(exemplar.picture.width, exemplar.picture.height) + ", expected " +
                            size_text(sizes.view_width, sizes.view_height) + ", the size of a view");
    check_views(exemplar.view_weights, "exemplar weights", sizes, 1);
  }
  if (!options.part_prompts.empty())
    check_views(inputs.part_views, "part views", sizes, static_cast<int>(options.part_prompts.size()));
  const int64_t noise_size =
      model.latent_channels() * sizes.grid * sizes.grid * sizes.latent_height * sizes.latent_width;
  if (static_cast<int64_t>(inputs.noise.size()) != noise_size) {
    usage("noise",
          "has " + std::to_string(inputs.noise.size()) + " values, expected " + std::to_string(noise_size));
  }
  const auto in_range = [](const std::string& name, double value, double low, double high) {
    if (!(value >= low && value <= high)) {
      usage(name, "is " + std::to_string(value) + ", expected " + std::to_string(low) + " to " +
                      std::to_string(high));
    }
  };
  in_range("steps", options.num_steps, 1, 1000);
  in_range("guidance scale", options.guidance_scale, 0, 100);
  in_range("strength", options.strength, 0, 1);
  for (const ControlKind& kind : kControlKinds)
    in_range(std::string(kind.name) + " scale", options.*kind.scale, 0, 10);
  in_range("fine detail", options.fine_detail, 0, 1);
  in_range("bias", options.bias_weight, -1000, 1000);
  check_bias(inputs.bias_levels, sizes, model.state().unet.config().levels.size());
  return sizes;
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
at::Tensor grid_hint(const Held<ControlNet>& network, const std::vector<Image>& views, int64_t grid) {
  std::vector<at::Tensor> tensors;
  tensors.reserve(views.size());
  for (const Image& view : views) tensors.push_back(tensor_from_image(view));
  return network.use()->hint(tile(tensors, grid));
}

/// Posterior means of the start images, scaled to unit variance, as one grid [C,H,W].
std::vector<float> start_latents(const Vae& vae, const std::vector<Image>& views, int64_t grid,
                                 const Progress& progress) {
  std::vector<at::Tensor> latents;
  for (const Image& view : views) {
    progress.throw_if_stopped();
    latents.push_back(vae.encode(2 * tensor_from_image(view) - 1).mean.cpu() * vae.config().scaling_factor);
    progress.update("encode", static_cast<double>(latents.size()), static_cast<double>(views.size()));
  }
  const at::Tensor tiled = tile(latents, grid).contiguous();
  return {tiled.data_ptr<float>(), tiled.data_ptr<float>() + tiled.numel()};
}

/// The negative one first where there is guidance, through all text encoders.
TextConditioning encode_texts(const Model::State& networks, const std::string& prompt,
                              const Guidance& guidance, int clip_skip) {
  std::vector<std::string> prompts{prompt};
  if (guidance.scale != 1) prompts.insert(prompts.begin(), guidance.negative_prompt);
  std::vector<TextConditioning> texts;
  for (const TextStage& text : networks.texts)
    texts.push_back(encode_prompts(text.tokenizer, *text.encoder.use(), text.words, prompts, clip_skip));
  return join_encoders(texts);
}

/// Means over the pixels of each of the grid's latent pixels, [C,H,W].
at::Tensor latent_means(const std::vector<Image>& views, const GridSizes& sizes) {
  std::vector<at::Tensor> means;
  means.reserve(views.size());
  for (const Image& view : views)
    means.push_back(
        at::adaptive_avg_pool2d(tensor_from_image(view), {sizes.latent_height, sizes.latent_width}));
  return tile(means, sizes.grid).squeeze(0);
}

/// The parts' shares [parts + 1,H,W] of the grid's latent pixels, before them what is left for the prompt.
at::Tensor latent_shares(const std::vector<Image>& part_views, const GridSizes& sizes) {
  const at::Tensor parts = latent_means(part_views, sizes);
  return at::cat({at::clamp_min(1 - parts.sum(0, /*keepdim=*/true), 0), parts});
}

/// What the denoiser needs of the exemplars; their noise follows from the seed.
std::vector<DenoiserReference> references_of(const Model::State& networks, const EditInputs& inputs,
                                             const EditOptions& options, const GridSizes& sizes,
                                             const Progress& progress) {
  std::vector<DenoiserReference> references;
  for (const EditInputs::Exemplar& exemplar : inputs.exemplars) {
    // An exemplar is as large as one view and shall count like all of them.
    const auto as_views = static_cast<double>(sizes.grid * sizes.grid);
    std::vector<float> x0 = start_latents(*networks.vae.use(), {exemplar.picture}, 1, progress);
    std::vector<float> noise =
        scheduler_noise(options.seed, -1 - static_cast<int>(references.size()), x0.size());
    references.push_back({std::move(x0),
                          std::move(noise),
                          {1, networks.vae.config().latent_channels, sizes.latent_height, sizes.latent_width},
                          encode_texts(networks, options.prompt, {1, {}}, options.clip_skip),
                          ReferenceWeights(as_views * latent_means(exemplar.view_weights, sizes)[0],
                                           networks.unet.config().levels.size())});
  }
  return references;
}

}  // namespace

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

bool guides_in_one_batch(const UNetConfig& unet, int64_t latent_pixels) {
  // Of small maps one batch is some 4 % faster, of larger ones as fast as two (docs/performance.md).
  constexpr int64_t kSmallMap = 2'000'000;
  return unet.levels.front().channels * latent_pixels <= kSmallMap;
}

std::vector<float> scheduler_noise(uint64_t seed, int call, size_t size) {
  std::vector<float> noise(size);
  for (size_t i = 0; i < size; i += 4) {
    const std::array<float, 4> four =
        gaussian4(seed, RandomPurpose::kSchedulerNoise, i / 4, static_cast<uint32_t>(call));
    std::copy_n(four.begin(), std::min<size_t>(4, size - i), noise.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return noise;
}

std::unique_ptr<EditRun> start_edit(const Model& model, const EditInputs& inputs, const EditOptions& options,
                                    const std::optional<Checkpoint>& resume, const Progress& progress) {
  auto run = std::make_unique<EditRun>();
  run->sizes = checked_sizes(model, inputs, options);
  const GridSizes& sizes = run->sizes;
  const Model::State& networks = model.state();

  run->plan = make_schedule(choose_scheduler(networks.scheduler, options.scheduler), options.num_steps);
  run->start = start_index(run->plan, options.strength);
  run->shape = {1, networks.vae.config().latent_channels, sizes.grid * sizes.latent_height,
                sizes.grid * sizes.latent_width};

  // What stays the same over all steps.
  run->bias = {inputs.bias_levels, options.bias_weight, options.bias_scaling == BiasScaling::kPaper};
  const Guidance guidance = guidance_of(model, options);
  const TextConditioning text = encode_texts(networks, options.prompt, guidance, options.clip_skip);
  std::vector<TextConditioning> part_texts;
  for (const PartPrompt& part : options.part_prompts)
    part_texts.push_back(encode_texts(
        networks, part.prompt, {guidance.scale, part.negative_prompt.value_or(guidance.negative_prompt)},
        options.clip_skip));
  std::optional<PartLevels> part_levels;
  if (!part_texts.empty())
    part_levels.emplace(latent_shares(inputs.part_views, sizes), networks.unet.config().levels.size());
  std::vector<Control> controls;
  for (size_t i = 0; i < kControlKinds.size(); ++i) {
    const Held<ControlNet>& network = networks.controlnets[i];
    controls.push_back({&network, grid_hint(network, inputs.*kControlKinds[i].views, sizes.grid),
                        options.*kControlKinds[i].scale});
  }
  run->denoiser = {&networks.unet,
                   std::move(controls),
                   text,
                   guidance.scale,
                   guides_in_one_batch(networks.unet.config(), run->shape[2] * run->shape[3]),
                   &run->bias,
                   options.bias_controlnet};
  run->denoiser.part_texts = std::move(part_texts);
  run->denoiser.part_levels = std::move(part_levels);
  run->denoiser.references = references_of(networks, inputs, options, sizes, progress);

  // Where each latent pixel joins; without strengths all do so at the start.
  std::vector<int> calls;
  if (!inputs.strength_views.empty())
    calls = first_calls(run->plan, options.strength,
                        latent_strengths(inputs.strength_views, inputs.grid, model.latent_scale()));
  const bool joins_late =
      std::any_of(calls.begin(), calls.end(), [&](int call) { return call > run->start; });
  std::vector<float> x0;
  if (joins_late || !resume)
    x0 = start_latents(*networks.vae.use(),
                       inputs.start_views.empty() ? inputs.tile_views : inputs.start_views, sizes.grid,
                       progress);
  if (joins_late) run->late = LateJoin{calls, x0, inputs.noise};

  // The start: the images at the noise level of the first step [Meng2022], or where an earlier run stood.
  SamplerState& state = run->state;
  if (resume) {
    state = sampler_state_from_bytes(resume->bytes);
    if (state.latents.size() != inputs.noise.size() || state.next_call < run->start ||
        state.next_call > run->plan.num_calls()) {
      throw Error(ErrorCode::kFormat, "checkpoint",
                  "belongs to a run with other sizes or steps; start the stage again");
    }
  } else {
    state.next_call = run->start;
    state.latents = add_noise(run->plan, run->start, x0, inputs.noise);
  }
  return run;
}

}  // namespace patina::diffusion
