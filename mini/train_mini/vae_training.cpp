#include "vae_training.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <mutex>
#include <random>

#include <ATen/ATen.h>
#include <c10/core/GradMode.h>
#include <c10/core/InferenceMode.h>
#include <nlohmann/json.hpp>

#include "colour_path.h"
#include "parameters.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/networks/vae.h"
#include "samples.h"
#include "workers.h"

namespace patina::train_mini {
namespace {

namespace fs = std::filesystem;
using diffusion::Vae;
using diffusion::VaeConfig;

constexpr double kKlWeight = 1e-4, kGradientWeight = 0.5, kColourWeight = 1;
constexpr int64_t kRecolouredOneIn = 3;  // crops
constexpr double kCheckpointSeconds = 180;
constexpr int64_t kHeldOutPictures = 24;

/// Sample `index`'s picture in [-1,1], [3,256,256].
at::Tensor picture(const SampleFolder& samples, int64_t index, int64_t which) {
  return samples.pictures(index)[which].to(at::kFloat) / 127.5 - 1;
}

/// The colour channels in another order: rusted and wooden things are all brown, and an autoencoder of
/// nothing else has no green.
at::Tensor recoloured(const at::Tensor& crop, std::mt19937_64& random) {
  std::array<int64_t, 3> order{0, 1, 2};
  std::shuffle(order.begin(), order.end(), random);
  return at::stack({crop[order[0]], crop[order[1]], crop[order[2]]});
}

at::Tensor random_crops(const SampleFolder& samples, const VaeTraining& options, std::mt19937_64& random) {
  std::vector<at::Tensor> crops;
  for (int64_t i = 0; i < options.batch; ++i) {
    const auto below = [&](int64_t end) {
      return static_cast<int64_t>(random() % static_cast<uint64_t>(end));
    };
    const int64_t index = below(samples.size()), which = below(4) == 0 ? kTile : kTarget;
    const int64_t free = mini_data::kViewSide - options.side + 1, y = below(free), x = below(free);
    at::Tensor crop =
        picture(samples, index, which).slice(1, y, y + options.side).slice(2, x, x + options.side);
    if (below(2)) crop = crop.flip({2});
    if (below(kRecolouredOneIn) == 0) crop = recoloured(crop, random);
    crops.push_back(crop);
  }
  return at::stack(crops).to(options.device);
}

/// Mean |difference| of neighbouring pixels' steps: blur shows here, where the plain difference hardly sees
/// it.
at::Tensor gradient_error(const at::Tensor& difference) {
  const at::Tensor dx = difference.slice(3, 1) - difference.slice(3, 0, -1),
                   dy = difference.slice(2, 1) - difference.slice(2, 0, -1);
  return dx.abs().mean() + dy.abs().mean();
}

/// Mean |difference| of the colours of blocks as large as a latent pixel. Hues are few in most pictures, so
/// the plain difference is slow to teach them.
at::Tensor colour_error(const at::Tensor& difference, int64_t block) {
  const at::Tensor mean = at::avg_pool2d(difference, block);
  const at::Tensor red_green = mean.select(1, 0) - mean.select(1, 1),
                   blue_yellow = mean.select(1, 2) - 0.5 * (mean.select(1, 0) + mean.select(1, 1));
  return red_green.abs().mean() + blue_yellow.abs().mean();
}

double psnr(double mean_square) {
  return -10 * std::log10(mean_square);
}

double held_out_psnr(const Vae& vae, const SampleFolder& samples, c10::Device device) {
  double sum = 0;
  const int64_t count = std::min(kHeldOutPictures, samples.size());
  for (int64_t i = 0; i < count; ++i) {
    const at::Tensor x = picture(samples, i * samples.size() / count, kTarget).unsqueeze(0).to(device);
    const at::Tensor y = vae.decode(vae.encode(x).mean).clamp(-1, 1);
    sum += psnr(((x - y) / 2).square().mean().item<double>());
  }
  return sum / static_cast<double>(count);
}

Vae vae_of(Parameters& parameters, const VaeConfig& config, at::ScalarType type) {
  nn::WeightReader weights(parameters, type);
  return Vae(config, weights);
}

}  // namespace

void train_vae(const fs::path& work, const fs::path& model, const VaeTraining& options) {
  const SampleFolder training(work / "training"), held_out(work / "held_out");
  const VaeConfig config = diffusion::read_vae_config(model / "vae");
  Parameters parameters("vae", options.run.seed, options.device);
  const fs::path checkpoint = work / "vae.checkpoint", step_file = work / "vae.step";
  parameters.read(checkpoint);
  Run run(options.run, work / "vae.log", fs::exists(step_file) ? std::stoll(read_text_file(step_file)) : 0);
  vae_of(parameters, config, at::kFloat);
  if (run.step() == 0) lay_colour_path(parameters);
  std::printf("VAE: %.2f M parameters, %lld training pictures\n",
              static_cast<double>(parameters.num_parameters()) * 1e-6,
              static_cast<long long>(training.size()));

  const auto save = [&] {
    parameters.write(checkpoint);
    write_file(step_file, std::to_string(run.step()));
    parameters.write_result(model / "vae" / "diffusion_pytorch_model.safetensors");
    const c10::InferenceMode inference;
    parameters.use_average(true);
    const double quality = held_out_psnr(vae_of(parameters, config, at::kFloat), held_out, options.device);
    parameters.use_average(false);
    std::printf("held out: %.2f dB\n", quality);
    std::fflush(stdout);
    return quality;
  };
  for (; !run.finished(); run.next()) {
    std::mt19937_64 random(options.run.seed + static_cast<uint64_t>(run.step()) * 0x9E3779B97F4A7C15u);
    at::manual_seed(random());
    const at::Tensor x = random_crops(training, options, random);
    const int64_t scale = config.latent_scale();
    const at::Tensor noise =
        at::randn({x.size(0), config.latent_channels, x.size(2) / scale, x.size(3) / scale}, x.options());
    const Vae vae = vae_of(parameters, config, training_type(options.device));
    std::mutex mutex;
    std::map<std::string, double> means;
    in_shares(options.run.workers, x.size(0), [&](int64_t begin, int64_t end) {
      const at::Tensor pictures = x.slice(0, begin, end);
      const diffusion::Posterior posterior = [&] {
        const c10::AutoGradMode records(!options.decoder_only);
        return vae.encode(pictures);
      }();
      const at::Tensor latents =
          posterior.mean + at::exp(0.5 * posterior.logvar) * noise.slice(0, begin, end);
      const at::Tensor difference = vae.decode(latents) - pictures;
      const at::Tensor kl =
          0.5 * (posterior.mean.square() + at::exp(posterior.logvar) - 1 - posterior.logvar).mean();
      const at::Tensor colour = colour_error(difference, scale);
      const at::Tensor reconstruction =
          difference.abs().mean() + kGradientWeight * gradient_error(difference) + kColourWeight * colour;
      const double share = static_cast<double>(end - begin) / static_cast<double>(x.size(0));
      ((options.decoder_only ? reconstruction : reconstruction + kKlWeight * kl) * share).backward();
      const std::lock_guard lock(mutex);
      means["loss"] += share * reconstruction.item<double>();
      means["kl"] += share * kl.item<double>();
      means["colour"] += share * colour.item<double>();
      means["square"] += share * (difference.detach() / 2).square().mean().item<double>();
    });
    const double norm = parameters.gradient_norm();
    if (norm > 1) parameters.scale_gradients(1 / norm);
    Parameters::Optimizer optimizer;
    optimizer.rate = run.rate();
    optimizer.weight_decay = 0;
    if (std::isfinite(norm)) parameters.step(optimizer, run.step());
    run.log({{"loss", means["loss"]},
             {"kl", means["kl"]},
             {"colour", means["colour"]},
             {"psnr", psnr(means["square"])},
             {"gradient", norm}});
    if (run.due(kCheckpointSeconds)) save();
  }
  save();
}

void encode_latents(const fs::path& work, const fs::path& model, c10::Device device) {
  const c10::InferenceMode inference;
  const Vae vae(model / "vae", training_type(device));
  double sum_of_squares = 0, count = 0;
  for (const char* part : {"training", "held_out"}) {
    const SampleFolder samples(work / part);
    write_file_with(work / part / "latents.f16", [&](const fs::path& temporary) {
      std::ofstream out(temporary, std::ios::binary);
      for (int64_t i = 0; i < samples.size(); ++i) {
        const at::Tensor aged = picture(samples, i, kTarget);
        const at::Tensor pictures = at::stack({aged, aged.flip({2})}).to(device);
        const at::Tensor latents = vae.encode(pictures).mean;
        sum_of_squares += latents.square().sum().item<double>();
        count += static_cast<double>(latents.numel());
        const at::Tensor halves = latents.to(at::kCPU, at::kHalf).contiguous();
        out.write(static_cast<const char*>(halves.data_ptr()), static_cast<std::streamsize>(halves.nbytes()));
        if (i % 200 == 0) {
          std::printf("latents %s %lld / %lld\n", part, static_cast<long long>(i),
                      static_cast<long long>(samples.size()));
          std::fflush(stdout);
        }
      }
      if (!out.flush())
        throw Error(ErrorCode::kIo, temporary.string(), "could not be written; is the disk full?");
    });
  }
  const fs::path config_file = model / "vae" / "config.json";
  auto config = nlohmann::ordered_json::parse(read_text_file(config_file));
  config["scaling_factor"] = 1 / std::sqrt(sum_of_squares / count);
  write_file(config_file, config.dump(2) + "\n");
  std::printf("scaling factor %.5f\n", 1 / std::sqrt(sum_of_squares / count));
}

}  // namespace patina::train_mini
