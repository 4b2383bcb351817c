#include "adversarial_training.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <mutex>
#include <random>
#include <string>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "decoder_data.h"
#include "discriminator.h"
#include "mini_data/octaves.h"
#include "parameters.h"
#include "patina/base/files.h"
#include "patina/diffusion/networks/vae.h"
#include "variogram.h"
#include "workers.h"

namespace patina::train_mini {
namespace {

namespace fs = std::filesystem;
using diffusion::Vae;

// A mean of absolute differences pulls at a picture with a force of one in all; the other losses, whose
// slopes are steeper, are weighted to pull about as much.
constexpr double kColourWeight = 1, kPixelWeight = 0.1, kGrainWeight = 0.1, kAdversarialWeight = 0.3,
                 kFeatureWeight = 0.1;
constexpr double kPenalty = 1;            // γ of R1 [Mescheder2018], a patch
constexpr double kDiscriminatorRate = 2;  // times the decoder's
constexpr double kAverage = 0.995;        // of a training of a few thousand steps
constexpr double kCheckpointSeconds = 480;
constexpr int64_t kHeldOutPictures = 8;
// Windows over which variograms are compared. Denoised latents show the same material in another place.
constexpr int64_t kEncodedWindow = 16, kDenoisedWindow = 32;

at::Tensor pooled_error(const at::Tensor& difference, int64_t block) {
  return at::avg_pool2d(difference, block).abs().mean();
}

/// Mean |difference| of the features' means over windows of 16 pixels.
at::Tensor feature_error(const Discriminator::Judgement& drawn, const Discriminator::Judgement& wanted,
                         int64_t side) {
  constexpr int64_t kWindow = 16;
  at::Tensor sum;
  for (size_t i = 0; i < drawn.features.size(); ++i) {
    const int64_t scale = side / drawn.features[i].size(2);
    const at::Tensor error = pooled_error(drawn.features[i] - wanted.features[i], kWindow / scale);
    sum = sum.defined() ? sum + error : error;
  }
  return sum;
}

using Means = std::map<std::string, double>;

/// The losses of some crops, sent back to the leaves: the discriminator's through `learning`, the decoder's
/// through `fixed`, which is the same network without gradients.
struct Step {
  const Vae& vae;
  const Discriminator &learning, &fixed;

  Means backward(const DecoderBatch& batch, double share) const {
    const int64_t count = batch.pictures.size(0), side = batch.pictures.size(2);
    const at::Tensor decoded = vae.decode(at::cat({batch.encoded, batch.denoised}));
    const at::Tensor from_encoded = decoded.slice(0, 0, count), from_denoised = decoded.slice(0, count);
    const at::Tensor true_grain = grain_of(batch.pictures), drawn_grain = grain_of(decoded);

    const at::Tensor true_scores = learning(true_grain).scores,
                     drawn_scores = learning(drawn_grain.detach()).scores;
    const at::Tensor slope = slope_penalty(learning, true_grain);
    (share * (at::softplus(-true_scores).mean() + at::softplus(drawn_scores).mean() + 0.5 * kPenalty * slope))
        .backward();

    const Discriminator::Judgement drawn = fixed(drawn_grain);
    const Discriminator::Judgement wanted = fixed(true_grain);
    Discriminator::Judgement drawn_from_encoded{{}, drawn.features};
    for (at::Tensor& feature : drawn_from_encoded.features) feature = feature.slice(0, 0, count);
    const at::Tensor difference = from_encoded - batch.pictures;
    const int64_t block = side / batch.colours.size(2);
    const at::Tensor colour = pooled_error(difference, block) + pooled_error(difference, block / 2) +
                              (at::avg_pool2d(from_denoised, block) - batch.colours).abs().mean();
    const at::Tensor pixel = difference.abs().mean();
    const at::Tensor grain = variogram_error(from_encoded, batch.pictures, kEncodedWindow) +
                             variogram_error(from_denoised, batch.pictures, kDenoisedWindow);
    const at::Tensor adversarial = at::softplus(-drawn.scores).mean();
    const at::Tensor feature = feature_error(drawn_from_encoded, wanted, side);
    (share * (kColourWeight * colour + kPixelWeight * pixel + kGrainWeight * grain +
              kAdversarialWeight * adversarial + kFeatureWeight * feature))
        .backward();

    const c10::NoGradGuard none;
    const auto mean_energy = [](const at::Tensor& x) {
      return mini_data::fine_energy(x).both.mean().item<double>();
    };
    const double wanted_energy = mean_energy(batch.pictures);
    Means means;
    means["slope"] = slope.item<double>();
    means["colour"] = colour.item<double>();
    means["pixel"] = pixel.item<double>();
    means["grain"] = grain.item<double>();
    means["energy_encoded"] = mean_energy(from_encoded) / wanted_energy;
    means["energy_denoised"] = mean_energy(from_denoised) / wanted_energy;
    means["feature"] = feature.item<double>();
    means["score_true"] = true_scores.mean().item<double>();
    means["score_drawn"] = drawn_scores.mean().item<double>();
    return means;
  }
};

DecoderBatch part_of(const DecoderBatch& batch, int64_t begin, int64_t end) {
  return {batch.encoded.slice(0, begin, end), batch.denoised.slice(0, begin, end),
          batch.pictures.slice(0, begin, end), batch.colours.slice(0, begin, end)};
}

DecoderBatch on_device(DecoderBatch batch, c10::Device device) {
  for (at::Tensor* tensor : {&batch.encoded, &batch.denoised, &batch.pictures, &batch.colours})
    *tensor = tensor->to(device);
  return batch;
}

Vae vae_of(Parameters& parameters, const diffusion::VaeConfig& config, c10::Device device) {
  nn::WeightReader weights(parameters, training_type(device));
  return Vae(config, weights);
}

Discriminator discriminator_of(Parameters& parameters, bool learning) {
  parameters.record_gradients(learning);
  nn::WeightReader weights(parameters, at::kFloat);
  return Discriminator(weights);
}

/// Over whole held-out pictures, of the object: decibels, and energy of the two finest octaves over the true.
void print_held_out(const Vae& vae, const SampleFolder& samples, c10::Device device) {
  const int64_t count = std::min(kHeldOutPictures, samples.size());
  double psnr = 0, drawn = 0, wanted = 0;
  for (int64_t i = 0; i < count; ++i) {
    const at::Tensor pictures = samples.pictures(i * samples.size() / count).to(device);
    const at::Tensor object = object_of(pictures).unsqueeze(0);
    const at::Tensor x = pictures[kTarget].to(at::kFloat).unsqueeze(0) / 127.5 - 1;
    const at::Tensor y = vae.decode(vae.encode(x).mean).clamp(-1, 1);
    const at::Tensor square = ((x - y) / 2).square().mean(1, /*keepdim=*/true);
    psnr -= 10 * std::log10((square * object).sum().item<double>() / object.sum().item<double>());
    const at::Tensor inside = mini_data::windows_inside(object);
    drawn += (mini_data::fine_energy(y).both * inside).sum().item<double>();
    wanted += (mini_data::fine_energy(x).both * inside).sum().item<double>();
  }
  std::printf("held out: %.2f dB over objects, energy %.3f\n", psnr / static_cast<double>(count),
              drawn / wanted);
  std::fflush(stdout);
}

}  // namespace

void train_adversarially(const fs::path& work, const fs::path& model, const AdversarialTraining& options) {
  const diffusion::VaeConfig config = diffusion::read_vae_config(model / "vae");
  const DecoderData data(work, config);
  const SampleFolder held_out(work / "held_out");
  const fs::path checkpoint = work / "decoder.checkpoint", judge_file = work / "discriminator.checkpoint",
                 step_file = work / "adversarial.step",
                 result = model / "vae" / "diffusion_pytorch_model.safetensors";
  Parameters decoder("vae", options.run.seed, options.device),
      judge("discriminator", options.run.seed + 1000000, options.device);
  if (fs::exists(checkpoint)) {
    decoder.read(checkpoint);
  } else {
    decoder.begin_with(result);
  }
  judge.read(judge_file);
  discriminator_of(judge, true);
  Run run(options.run, work / "adversarial.log",
          fs::exists(step_file) ? std::stoll(read_text_file(step_file)) : 0);
  std::printf("discriminator: %.2f M parameters; %lld samples\n",
              static_cast<double>(judge.num_parameters()) * 1e-6, static_cast<long long>(data.size()));

  const auto save = [&] {
    decoder.write(checkpoint);
    judge.write(judge_file);
    write_file(step_file, std::to_string(run.step()));
    decoder.write_result(result);
    const c10::InferenceMode inference;
    decoder.use_average(true);
    print_held_out(vae_of(decoder, config, options.device), held_out, options.device);
    decoder.use_average(false);
  };
  for (; !run.finished(); run.next()) {
    std::mt19937_64 random(options.run.seed + static_cast<uint64_t>(run.step()) * 0x9E3779B97F4A7C15u);
    const DecoderBatch batch = on_device(data.draw(options.batch, options.side, random), options.device);
    const Vae vae = vae_of(decoder, config, options.device);
    const Discriminator learning = discriminator_of(judge, true), fixed = discriminator_of(judge, false);
    const Step step{vae, learning, fixed};
    std::mutex mutex;
    Means means;
    in_shares(options.run.workers, options.batch, [&](int64_t begin, int64_t end) {
      const double share = static_cast<double>(end - begin) / static_cast<double>(options.batch);
      const Means part = step.backward(part_of(batch, begin, end), share);
      const std::lock_guard lock(mutex);
      for (const auto& [name, value] : part) means[name] += share * value;
    });
    Parameters::Optimizer optimizer;
    optimizer.beta1 = 0.5;
    optimizer.weight_decay = 0;
    optimizer.average = kAverage;
    for (Parameters* parameters : {&decoder, &judge}) {
      const double norm = parameters->gradient_norm();
      means[parameters->where() + "_gradient"] = norm;
      if (parameters == &decoder && norm > 1) decoder.scale_gradients(1 / norm);
      optimizer.rate = run.rate() * (parameters == &judge ? kDiscriminatorRate : 1);
      if (std::isfinite(norm)) parameters->step(optimizer, run.step());
    }
    run.log(means);
    if (run.due(kCheckpointSeconds)) save();
  }
  save();
}

}  // namespace patina::train_mini
