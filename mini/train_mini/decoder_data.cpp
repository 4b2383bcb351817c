#include "decoder_data.h"

#include <cstdio>
#include <fstream>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/base/error.h"
#include "patina/diffusion/edit_run.h"

namespace patina::train_mini {
namespace {

namespace fs = std::filesystem;
using mini_data::kViewSide;

constexpr int kSteps = 8;               // of an edit; with 20 the latents are much the same
constexpr double kLeastStrength = 0.4;  // of an edit
constexpr double kLeastObject = 0.25;   // share of a crop
constexpr int kTries = 3;               // for such a crop

fs::path records_file(const fs::path& work) {
  return work / "training" / "decoder.f16";
}

/// Numbers of a record of C latent channels and `side` latent pixels a side: both latents and the colours.
int64_t record_size(int64_t channels, int64_t side) {
  return (2 * channels + 3) * side * side;
}

/// Latents [1,C,h,w], unscaled, that MODEL paints over a sample.
at::Tensor denoised_latents(const diffusion::Model& model, const at::Tensor& pictures,
                            const std::string& caption, std::mt19937_64& random) {
  const auto image = [&](int64_t which) {
    return diffusion::image_from_tensor(pictures[which].to(at::kFloat).unsqueeze(0) / 255.0);
  };
  diffusion::EditInputs inputs;
  inputs.tile_views = {image(kTile)};
  inputs.normal_views = {image(kNormal)};
  inputs.start_views = {image(kTarget)};
  const auto side = static_cast<size_t>(kViewSide / model.latent_scale());
  inputs.noise =
      diffusion::scheduler_noise(random(), 0, static_cast<size_t>(model.latent_channels()) * side * side);
  diffusion::EditOptions options;
  options.prompt = caption;
  options.num_steps = kSteps;
  options.strength = static_cast<float>(std::uniform_real_distribution<double>(kLeastStrength, 1)(random));
  const std::unique_ptr<diffusion::EditRun> run = start_edit(model, inputs, options, {}, {});
  const diffusion::SamplerCallbacks callbacks{
      [&](int call, size_t size) { return diffusion::scheduler_noise(options.seed, call, size); }, {}};
  const std::vector<float> latents =
      sample(run->denoiser, run->plan, std::move(run->state), run->shape, callbacks);
  return at::tensor(latents).view(run->shape) / model.state().vae.config().scaling_factor;
}

}  // namespace

at::Tensor object_of(const at::Tensor& pictures) {
  return (pictures[kNormal][2] > 64).to(at::kFloat).unsqueeze(0);
}

void make_decoder_data(const fs::path& work, const fs::path& model_folder, int64_t count, uint64_t seed) {
  const c10::InferenceMode inference;
  const SampleFolder samples(work / "training");
  diffusion::ModelPaths paths;
  paths.model = model_folder;
  const diffusion::Model model(find_model_parts(paths), {});
  const std::shared_ptr<const diffusion::Vae> vae = model.state().vae.use();
  const int64_t scale = vae->config().latent_scale();
  const int64_t bytes =
      record_size(vae->config().latent_channels, kViewSide / scale) * static_cast<int64_t>(sizeof(at::Half));
  const fs::path file = records_file(work);
  int64_t done = fs::exists(file) ? static_cast<int64_t>(fs::file_size(file)) / bytes : 0;
  if (fs::exists(file)) fs::resize_file(file, static_cast<uintmax_t>(done * bytes));
  std::ofstream out(file, std::ios::binary | std::ios::app);
  for (count = std::min(count, samples.size()); done < count; ++done) {
    std::mt19937_64 random(seed + static_cast<uint64_t>(done) * 0x9E3779B97F4A7C15u);
    const at::Tensor pictures = samples.pictures(done);
    const at::Tensor encoded = vae->encode(pictures[kTarget].to(at::kFloat).unsqueeze(0) / 127.5 - 1).mean;
    const at::Tensor denoised =
        denoised_latents(model, pictures, samples.samples()[static_cast<size_t>(done)].caption, random);
    const at::Tensor colours = at::avg_pool2d(vae->decode(denoised), scale);
    const at::Tensor record = at::cat({encoded, denoised, colours}, 1).to(at::kHalf).contiguous();
    out.write(static_cast<const char*>(record.data_ptr()), static_cast<std::streamsize>(record.nbytes()));
    if (!out.flush()) throw Error(ErrorCode::kIo, file.string(), "could not be written; is the disk full?");
    if (done % 20 == 0) {
      std::printf("decoder data %lld / %lld\n", static_cast<long long>(done), static_cast<long long>(count));
      std::fflush(stdout);
    }
  }
}

DecoderData::DecoderData(const fs::path& work, const diffusion::VaeConfig& vae)
    : samples_(work / "training"),
      records_(records_file(work)),
      channels_(vae.latent_channels),
      scale_(vae.latent_scale()),
      side_(kViewSide / scale_) {
  const int64_t bytes = record_size(channels_, side_) * static_cast<int64_t>(sizeof(at::Half));
  size_ = std::min(static_cast<int64_t>(records_.bytes().size()) / bytes, samples_.size());
  if (size_ == 0)
    throw Error(ErrorCode::kFormat, records_file(work).string(),
                "holds no latents; make them with: train_mini decoder-data");
}

DecoderBatch DecoderData::draw(int64_t count, int64_t side, std::mt19937_64& random) const {
  const auto below = [&](int64_t end) { return static_cast<int64_t>(random() % static_cast<uint64_t>(end)); };
  const int64_t cut = side / scale_;  // latent pixels
  std::vector<at::Tensor> records, pictures;
  for (int64_t i = 0; i < count; ++i) {
    int64_t index = 0, y = 0, x = 0;
    at::Tensor crop;
    for (int t = 0; t < kTries; ++t) {
      index = below(size_), y = below(side_ - cut + 1), x = below(side_ - cut + 1);
      crop = samples_.pictures(index)
                 .slice(2, scale_ * y, scale_ * (y + cut))
                 .slice(3, scale_ * x, scale_ * (x + cut));
      if (object_of(crop).mean().item<double>() >= kLeastObject) break;
    }
    const int64_t size = record_size(channels_, side_);
    auto* data =
        const_cast<uint8_t*>(records_.bytes().data()) + index * size * static_cast<int64_t>(sizeof(at::Half));
    records.push_back(at::from_blob(data, {2 * channels_ + 3, side_, side_}, at::kHalf)
                          .slice(1, y, y + cut)
                          .slice(2, x, x + cut)
                          .to(at::kFloat));
    pictures.push_back(crop[kTarget].to(at::kFloat) / 127.5 - 1);
  }
  const at::Tensor record = at::stack(records);
  return {record.slice(1, 0, channels_), record.slice(1, channels_, 2 * channels_), at::stack(pictures),
          record.slice(1, 2 * channels_)};
}

}  // namespace patina::train_mini
