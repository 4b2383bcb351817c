#include "denoiser_training.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "denoiser_data.h"
#include "parameters.h"
#include "patina/base/files.h"
#include "patina/diffusion/networks/controlnet.h"
#include "patina/diffusion/networks/text_encoder.h"
#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/schedulers/schedulers.h"
#include "workers.h"

namespace patina::train_mini {
namespace {

namespace fs = std::filesystem;
using namespace diffusion;

constexpr double kSnrLimit = 5;  // γ of min-SNR weighting [Hang2023]
// Share of samples without the one or the other condition. The render says so much that words are hardly
// listened to beside it: without it they must be.
constexpr double kTileDropout = 0.35, kNormalDropout = 0.12;
// Share of samples whose time is drawn from the noisier part alone, where words decide most.
constexpr double kNoisyShare = 0.5;
constexpr double kMomentum = 0.95;
constexpr double kCheckpointSeconds = 240;
constexpr int64_t kViewsMeasured = 24;
constexpr double kAverage = 0.998;  // of a training of ten thousand steps

constexpr std::array<const char*, 4> kComponents{"text_encoder", "unet", "controlnet_tile",
                                                 "controlnet_normal"};

fs::path checkpoint_of(const fs::path& work, const std::string& component) {
  return work / (component + ".checkpoint");
}
fs::path result_of(const fs::path& model, const std::string& component) {
  return model / component /
         (component == "text_encoder" ? "model.safetensors" : "diffusion_pytorch_model.safetensors");
}

struct Configs {
  TextEncoderConfig text;
  UNetConfig unet;
  ControlNetConfig tile, normal;
};

struct Networks {
  TextEncoder text;
  UNet unet;
  ControlNet tile, normal;
};

using Stores = std::vector<std::unique_ptr<Parameters>>;  // in the order of kComponents

Networks networks_of(const Stores& stores, const Configs& configs, at::ScalarType type) {
  const auto reader = [&](size_t i) { return nn::WeightReader(*stores[i], type); };
  nn::WeightReader text = reader(0), unet = reader(1), tile = reader(2), normal = reader(3);
  return {TextEncoder(configs.text, text), UNet(configs.unet, unet), ControlNet(configs.tile, tile),
          ControlNet(configs.normal, normal)};
}

/// Residuals of a ControlNet, each sample's times its own scale [B].
ControlResiduals scaled(ControlResiduals residuals, const at::Tensor& scale) {
  for (at::Tensor& down : residuals.down) down = down * scale.view({-1, 1, 1, 1}).to(down.scalar_type());
  residuals.mid = residuals.mid * scale.view({-1, 1, 1, 1}).to(residuals.mid.scalar_type());
  return residuals;
}

/// Mean square error of the predicted velocity [Salimans2022], one a sample, [B].
at::Tensor velocity_error(const Networks& networks, const DenoiserBatch& batch, const at::Tensor& noise,
                          const at::Tensor& timesteps, const at::Tensor& alphas_cumprod,
                          const at::Tensor& tile_scale, const at::Tensor& normal_scale) {
  const at::Tensor alpha_bar = alphas_cumprod.index_select(0, timesteps).view({-1, 1, 1, 1});
  const at::Tensor signal = alpha_bar.sqrt(), spread = (1 - alpha_bar).sqrt();
  const at::Tensor noisy = signal * batch.latents + spread * noise;
  const at::Tensor velocity = signal * noise - spread * batch.latents;

  const NetworkInputs inputs{noisy, timesteps.to(at::kFloat), networks.text(batch.ids)};
  const ControlResiduals tile =
      scaled(networks.tile(inputs, networks.tile.hint(batch.tile), 1.0f), tile_scale);
  const ControlResiduals normal =
      scaled(networks.normal(inputs, networks.normal.hint(batch.normal), 1.0f), normal_scale);
  const at::Tensor predicted = networks.unet(inputs, sum(tile, normal)).to(at::kFloat);
  return (predicted - velocity).square().mean({1, 2, 3});
}

DenoiserBatch part_of(const DenoiserBatch& batch, int64_t begin, int64_t end) {
  return {batch.latents.slice(0, begin, end), batch.tile.slice(0, begin, end),
          batch.normal.slice(0, begin, end), batch.ids.slice(0, begin, end)};
}

DenoiserBatch on_device(DenoiserBatch batch, c10::Device device) {
  for (at::Tensor* tensor : {&batch.latents, &batch.tile, &batch.normal, &batch.ids})
    *tensor = tensor->to(device);
  return batch;
}

struct ViewErrors {
  double asked = 0;   // with its own words
  double others = 0;  // with the words of another sample: larger where words are listened to
};

/// Mean errors over views at one time, all conditions on.
ViewErrors view_errors(const Networks& networks, const DenoiserData& data, const at::Tensor& alphas_cumprod,
                       int64_t time, c10::Device device) {
  const int64_t num_views = std::min(kViewsMeasured, data.size());
  std::mt19937_64 random(7);
  at::manual_seed(7);
  DenoiserBatch batch = on_device(data.draw(Cut::kView, num_views, random, /*vary=*/false), device);
  const at::Tensor ones = at::ones({num_views}, at::device(device));
  const at::Tensor timesteps = at::full({num_views}, time, at::device(device).dtype(at::kLong));
  const at::Tensor noise = at::randn_like(batch.latents);
  const auto error = [&] {
    return velocity_error(networks, batch, noise, timesteps, alphas_cumprod, ones, ones)
        .mean()
        .item<double>();
  };
  ViewErrors errors;
  errors.asked = error();
  batch.ids = batch.ids.roll(1, 0);
  errors.others = error();
  return errors;
}

}  // namespace

void train_denoiser(const fs::path& work, const fs::path& model, const DenoiserTraining& options) {
  const DenoiserData training(work / "training", model), held_out(work / "held_out", model);
  const Configs configs{read_text_encoder_config(model / "text_encoder"), read_unet_config(model / "unet"),
                        read_controlnet_config(model / "controlnet_tile"),
                        read_controlnet_config(model / "controlnet_normal")};
  Stores stores;
  for (const char* component : kComponents) {
    stores.push_back(
        std::make_unique<Parameters>(component, options.run.seed + 1000000 * stores.size(), options.device));
    const fs::path checkpoint = checkpoint_of(work, component);
    if (options.from_model && !fs::exists(checkpoint)) stores.back()->begin_with(result_of(model, component));
    stores.back()->read(checkpoint);
  }
  networks_of(stores, configs, at::kFloat);
  for (const auto& store : stores)
    std::printf("%s: %.2f M parameters\n", store->where().c_str(),
                static_cast<double>(store->num_parameters()) * 1e-6);

  const fs::path scheduler_file = model / "scheduler" / "scheduler_config.json";
  const SchedulePlan plan =
      make_schedule(parse_scheduler_config(read_text_file(scheduler_file), scheduler_file.string()), 10);
  const at::Tensor alphas_cumprod = at::tensor(plan.alphas_cumprod, at::kFloat).to(options.device);
  const fs::path step_file = work / "denoiser.step";
  Run run(options.run, work / "denoiser.log",
          fs::exists(step_file) ? std::stoll(read_text_file(step_file)) : 0);

  const auto save = [&] {
    for (size_t i = 0; i < stores.size(); ++i) {
      stores[i]->write(checkpoint_of(work, kComponents[i]));
      stores[i]->write_result(result_of(model, kComponents[i]));
      stores[i]->use_average(true);
    }
    write_file(step_file, std::to_string(run.step()));
    const c10::InferenceMode inference;
    const Networks averaged = networks_of(stores, configs, training_type(options.device));
    std::printf("velocity error held out (with others' words, on training views):");
    for (const int64_t time : {50, 200, 400, 600, 800, 950}) {
      const ViewErrors unseen = view_errors(averaged, held_out, alphas_cumprod, time, options.device);
      const ViewErrors seen = view_errors(averaged, training, alphas_cumprod, time, options.device);
      std::printf(" t=%lld %.4f (%.4f, %.4f)", static_cast<long long>(time), unseen.asked, unseen.others,
                  seen.asked);
    }
    for (const auto& store : stores) store->use_average(false);
    std::printf("\n");
    std::fflush(stdout);
  };

  for (; !run.finished(); run.next()) {
    std::mt19937_64 random(options.run.seed + static_cast<uint64_t>(run.step()) * 0x9E3779B97F4A7C15u);
    at::manual_seed(random());
    const double lot = std::uniform_real_distribution<double>(0, 1)(random);
    const Cut cut = lot < options.share_of_crops                            ? Cut::kCrop
                    : lot < options.share_of_crops + options.share_of_grids ? Cut::kGrid
                                                                            : Cut::kView;
    const int64_t count = cut == Cut::kCrop   ? options.crops
                          : cut == Cut::kView ? options.views
                                              : options.grids;
    const DenoiserBatch batch = on_device(training.draw(cut, count, random, /*vary=*/true), options.device);
    const auto device = at::device(options.device);
    const int64_t num_times = plan.config.num_train_timesteps, noisy = num_times * 2 / 5;
    const at::Tensor timesteps = at::where(at::rand({count}, device) < kNoisyShare,
                                           at::randint(noisy, num_times, {count}, device.dtype(at::kLong)),
                                           at::randint(0, num_times, {count}, device.dtype(at::kLong)));
    const at::Tensor tile_scale = (at::rand({count}, device) >= kTileDropout).to(at::kFloat);
    const at::Tensor normal_scale = (at::rand({count}, device) >= kNormalDropout).to(at::kFloat);

    const at::Tensor noise = at::randn_like(batch.latents);
    const Networks networks = networks_of(stores, configs, training_type(options.device));
    std::mutex mutex;
    double mean_error = 0, mean_loss = 0;
    in_shares(options.run.workers, count, [&](int64_t begin, int64_t end) {
      const auto part = [&](const at::Tensor& whole) { return whole.slice(0, begin, end); };
      const at::Tensor errors =
          velocity_error(networks, part_of(batch, begin, end), part(noise), part(timesteps), alphas_cumprod,
                         part(tile_scale), part(normal_scale));
      const at::Tensor alpha_bar = alphas_cumprod.index_select(0, part(timesteps));
      const at::Tensor snr = alpha_bar / (1 - alpha_bar);
      const at::Tensor loss =
          (errors * (at::clamp_max(snr, kSnrLimit) + 1) / (snr + 1)).sum() / static_cast<double>(count);
      loss.backward();
      const std::lock_guard lock(mutex);
      mean_error += errors.detach().sum().item<double>() / static_cast<double>(count);
      mean_loss += loss.item<double>();
    });

    double squares = 0;
    for (const auto& store : stores) squares += std::pow(store->gradient_norm(), 2);
    const double norm = std::sqrt(squares);
    Parameters::Optimizer optimizer;
    optimizer.rate = run.rate();
    optimizer.momentum = kMomentum;
    optimizer.average = kAverage;
    optimizer.workers = options.run.workers;
    if (std::isfinite(norm)) {
      for (const auto& store : stores) {
        if (norm > 1) store->scale_gradients(1 / norm);
        store->step(optimizer, run.step());
      }
    }
    const char* kind = cut == Cut::kCrop ? "crop" : cut == Cut::kView ? "view" : "grid";
    run.log({{kind, mean_error}, {"loss", mean_loss}, {"gradient", norm}});
    if (run.due(kCheckpointSeconds)) save();
  }
  save();
}

}  // namespace patina::train_mini
