// The trainer's parts: gradients through networks that are built of its parameters, its optimiser, its files.
#include <cmath>
#include <fstream>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/edit.h"
#include "patina/diffusion/edit_run.h"
#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/networks/vae.h"
#include "patina/nn/attend.h"
#include "support.h"
#include "train_mini/adversarial_training.h"
#include "train_mini/colour_path.h"
#include "train_mini/decoder_data.h"
#include "train_mini/denoiser_training.h"
#include "train_mini/discriminator.h"
#include "train_mini/parameters.h"
#include "train_mini/samples.h"
#include "train_mini/vae_training.h"
#include "train_mini/variogram.h"
#include "train_mini/words_training.h"
#include "train_mini/workers.h"

namespace patina::train_mini {
namespace {

namespace fs = std::filesystem;

TEST(Parameters, gradients_reach_the_leaves_through_a_conversion) {
  Parameters parameters("test", 1, c10::kCPU);
  const at::Tensor factors = at::tensor({1.0f, -2.0f, 0.5f, 4.0f}).view({2, 2});
  const auto loss = [&] {
    return (parameters.find("a.weight", {2, 2}, at::kBFloat16).to(at::kFloat) * factors).sum();
  };
  loss().backward();
  EXPECT_NEAR(parameters.gradient_norm(), factors.norm().item<double>(), 1e-6);
}

TEST(Parameters, hold_still_where_no_gradients_are_recorded) {
  Parameters parameters("test", 1, c10::kCPU);
  const at::Tensor x = at::ones({2, 2}).set_requires_grad(true);
  parameters.record_gradients(false);
  (parameters.find("a.weight", {2, 2}, at::kFloat) * x).sum().backward();
  EXPECT_EQ(parameters.gradient_norm(), 0);
  EXPECT_TRUE(x.grad().equal(parameters.start_of("a.weight")));
  parameters.record_gradients(true);
  EXPECT_TRUE(parameters.find("a.weight", {2, 2}, at::kFloat).requires_grad());
}

TEST(Parameters, one_step_is_adamw_with_decoupled_decay) {
  Parameters parameters("test", 1, c10::kCPU);
  const at::Tensor before = parameters.find("a.weight", {3, 5}, at::kFloat).detach().clone();
  const at::Tensor slope = at::linspace(-1, 1, 15).view({3, 5});
  const Parameters::Optimizer adam{
      .rate = 0.01, .beta1 = 0.9, .beta2 = 0.99, .epsilon = 1e-8, .weight_decay = 0.1};
  at::Tensor expected = before.to(at::kDouble);
  at::Tensor first = at::zeros_like(expected), second = at::zeros_like(expected);
  const at::Tensor g = slope.to(at::kDouble);
  for (int64_t step = 0; step < 3; ++step) {
    (parameters.find("a.weight", {3, 5}, at::kFloat) * slope).sum().backward();
    parameters.step(adam, step);
    const auto n = static_cast<double>(step + 1);
    first = 0.9 * first + 0.1 * g;
    second = 0.99 * second + 0.01 * g * g;
    expected = expected * (1 - 0.01 * 0.1) -
               0.01 * (first / (1 - std::pow(0.9, n))) / ((second / (1 - std::pow(0.99, n))).sqrt() + 1e-8);
  }
  const at::Tensor after = parameters.find("a.weight", {3, 5}, at::kFloat).detach();
  EXPECT_LT((after.to(at::kDouble) - expected).abs().max().item<double>(), 1e-6);
}

TEST(Parameters, go_on_from_a_file_as_if_never_stopped) {
  const test::TemporaryFolder folder;
  const auto one_step = [](Parameters& parameters, int64_t step) {
    const at::Tensor w = parameters.find("a.weight", {4, 4}, at::kFloat);
    (w * w * static_cast<double>(step + 1)).sum().backward();
    parameters.step({}, step);
  };
  Parameters straight("test", 3, c10::kCPU);
  for (int64_t step = 0; step < 4; ++step) one_step(straight, step);

  Parameters first("test", 3, c10::kCPU), second("test", 99, c10::kCPU);
  for (int64_t step = 0; step < 2; ++step) one_step(first, step);
  first.write(folder.path() / "half");
  second.read(folder.path() / "half");
  for (int64_t step = 2; step < 4; ++step) one_step(second, step);
  const auto value = [](Parameters& p) { return p.find("a.weight", {4, 4}, at::kFloat).detach(); };
  EXPECT_TRUE(at::equal(value(straight), value(second)));
  straight.use_average(true), second.use_average(true);
  EXPECT_TRUE(at::equal(value(straight), value(second)));
}

// The gradient of a whole U-Net, attention to text and image included, against finite differences.
TEST(Parameters, gradients_of_a_network_are_the_slopes_of_its_loss) {
  diffusion::UNetConfig config = diffusion::read_unet_config(test::data_dir() / "tiny-sd" / "unet");
  Parameters parameters("unet", 5, c10::kCPU);
  at::manual_seed(3);
  const at::Tensor sample = at::randn({2, 4, 8, 8}), text = at::randn({2, 5, 64}),
                   target = at::randn({2, 4, 8, 8});
  const auto loss = [&] {
    nn::WeightReader weights(parameters, at::kFloat);
    const diffusion::UNet unet(config, weights);
    return (unet({sample, at::tensor({10.0f, 700.0f}), {text, {}}}) - target).to(at::kDouble).square().mean();
  };
  loss().backward();
  for (const char* name :
       {"conv_in.weight", "down_blocks.0.attentions.0.transformer_blocks.0.attn1.to_q.weight",
        "mid_block.attentions.0.transformer_blocks.0.attn2.to_v.weight", "time_embedding.linear_2.weight",
        "up_blocks.3.resnets.2.conv2.weight", "conv_norm_out.weight"}) {
    at::Tensor weight = parameters.find(name, {}, at::kFloat);
    const at::Tensor gradient = weight.grad().clone();
    // Along the gradient itself the loss must rise by its square norm.
    const at::Tensor direction = gradient / gradient.norm();
    const c10::NoGradGuard no_gradients;
    const double step = 2e-2;
    weight.add_(direction, step);
    const double above = loss().item<double>();
    weight.add_(direction, -2 * step);
    const double below = loss().item<double>();
    weight.add_(direction, step);
    const double slope = (above - below) / (2 * step), expected = gradient.norm().item<double>();
    EXPECT_NEAR(slope, expected, 0.02 * expected + 1e-6) << name;
  }
}

TEST(Attend, gives_the_same_with_gradients_as_without) {
  at::manual_seed(1);
  const at::Tensor q = at::randn({2, 33, 24}), k = at::randn({2, 17, 24}), v = at::randn({2, 17, 24});
  const at::Tensor plain = nn::attend(q, k, v, 3);
  const at::Tensor recorded = nn::attend(q.clone().set_requires_grad(true), k, v, 3);
  EXPECT_TRUE(recorded.requires_grad());
  EXPECT_LT((plain - recorded).abs().max().item<float>(), 1e-5f);
}

Discriminator random_discriminator() {
  Parameters parameters("discriminator", 4, c10::kCPU);
  nn::WeightReader weights(parameters, at::kFloat);
  return Discriminator(weights);
}

TEST(Discriminator, scores_every_eight_pixels_by_what_lies_within_54) {
  const at::Tensor grain = at::randn({2, 3, 128, 128}).set_requires_grad(true);
  const at::Tensor scores = random_discriminator()(grain).scores;
  ASSERT_EQ(scores.sizes(), at::IntArrayRef({2, 1, 16, 16}));
  scores[0][0][8][8].backward();
  const at::Tensor seen = grain.grad()[0].abs().sum(0);
  const auto extent = [&](int64_t axis) { return (seen.sum(axis) > 0).sum().item<int64_t>(); };
  EXPECT_EQ(extent(0), 54);
  EXPECT_EQ(extent(1), 54);
  EXPECT_EQ(grain.grad()[1].abs().sum().item<float>(), 0);
}

TEST(Discriminator, sees_no_colour_that_does_not_change_from_pixel_to_pixel) {
  const at::Tensor noise = 0.1 * at::randn({1, 3, 32, 32}), colour = at::randn({1, 3, 1, 1});
  EXPECT_LT((grain_of(noise + colour) - grain_of(noise)).abs().max().item<float>(), 1e-5f);
}

TEST(Discriminator, slope_penalty_is_the_square_of_finite_differences) {
  const Discriminator discriminator = random_discriminator();
  at::manual_seed(2);
  const at::Tensor grain = at::randn({1, 3, 16, 16});
  at::Tensor slope = at::zeros_like(grain);
  const c10::InferenceMode inference;
  const double step = 1e-2;
  for (int64_t i = 0; i < grain.numel(); ++i) {
    at::Tensor moved = grain.clone();
    moved.view(-1)[i] += step;
    const double above = discriminator(moved).scores.sum().item<double>();
    moved.view(-1)[i] -= 2 * step;
    slope.view(-1)[i] = (above - discriminator(moved).scores.sum().item<double>()) / (2 * step);
  }
  const double expected = slope.square().sum().item<double>() / 4;
  const auto penalty = [&] {
    const c10::InferenceMode no_inference(false);
    return slope_penalty(discriminator, grain.clone()).item<double>();
  };
  EXPECT_NEAR(penalty(), expected, 0.02 * expected);
}

/// Of light [5 differences], `distance` index of 1, 2 and 4 pixels, in the first window.
at::Tensor variogram_of_light(const at::Tensor& pictures, int64_t window, int64_t distance) {
  return variogram(pictures, window)[0].select(1, 0).select(1, 0).view({3, 5, 3})[distance].select(1, 0);
}

TEST(Variogram, knows_white_noise) {
  at::manual_seed(3);
  const at::Tensor noise = 0.1 * at::randn({1, 3, 136, 136});
  // Differences of independent values have twice their variance, differences of differences four times.
  const at::Tensor expected = at::tensor({2.0f, 2.0f, 2.0f, 2.0f, 4.0f}) * 0.01 / 3;
  for (const int64_t distance : {0, 1, 2})
    EXPECT_LT((variogram_of_light(noise, 128, distance) / expected - 1).abs().max().item<float>(), 0.1f);
}

TEST(Variogram, knows_the_direction_of_stripes_and_a_weave) {
  const at::Tensor columns = (at::arange(64) % 2).to(at::kFloat).expand({1, 3, 64, 64});
  EXPECT_TRUE(variogram_of_light(columns, 32, 0).equal(at::tensor({1.0f, 0.0f, 1.0f, 1.0f, 0.0f})));
  EXPECT_TRUE(variogram_of_light(columns, 32, 1).equal(at::zeros({5})));
  const at::Tensor weave = columns + columns.transpose(2, 3);
  EXPECT_TRUE(variogram_of_light(weave, 32, 0).equal(at::tensor({1.0f, 1.0f, 2.0f, 2.0f, 0.0f})));
}

TEST(Variogram, error_asks_for_the_same_grain_in_any_place) {
  at::manual_seed(5);
  const at::Tensor noise = 0.1 * at::randn({1, 3, 72, 72}), other = 0.1 * at::randn({1, 3, 72, 72});
  EXPECT_EQ(variogram_error(noise, noise, 64).item<double>(), 0);
  EXPECT_LT(variogram_error(noise, other, 64).item<double>(), 0.02);
  // Of a quarter of the energy the logarithm, less half of what is quadratic.
  EXPECT_NEAR(variogram_error(0.5 * noise, noise, 64).item<double>(), std::log(4) - 0.35, 0.05);
}

// Pictures of coloured bands: little, but something that can be learnt.
void write_samples(const fs::path& folder, int count) {
  fs::create_directories(folder);
  std::ofstream pictures(folder / "pictures.u8", std::ios::binary), lines(folder / "samples.jsonl");
  for (int i = 0; i < count; ++i) {
    const at::Tensor wave = (at::sin(at::arange(256) * (0.02 * (i + 1))) * 100 + 128).to(at::kByte);
    const at::Tensor record = wave.expand({9, 256, 256}).contiguous();
    pictures.write(static_cast<const char*>(record.data_ptr()), record.numel());
    lines << R"({"caption": "a band", "class": "band", "views": 4, "view": )" << i % 4 << "}\n";
  }
}

TEST(SampleFolder, gives_pictures_and_captions_and_ignores_a_record_that_was_cut) {
  const test::TemporaryFolder folder;
  write_samples(folder.path(), 3);
  fs::resize_file(folder.path() / "pictures.u8", 2 * 9 * 256 * 256 + 100);
  const SampleFolder samples(folder.path());
  ASSERT_EQ(samples.size(), 2);
  EXPECT_EQ(samples.samples()[1].caption, "a band");
  EXPECT_EQ(samples.pictures(0)[0][0][0][0].item<int>(), 128);
}

TEST(Workers, share_a_batch_and_add_their_gradients_in_the_same_leaves) {
  const at::Tensor x = at::randn({7, 5}), leaf = at::randn({5}).set_requires_grad(true);
  const auto gradient = [&](int64_t workers) {
    leaf.mutable_grad() = at::Tensor();
    in_shares(workers, 7, [&](int64_t begin, int64_t end) {
      at::tanh(at::matmul(x.slice(0, begin, end), leaf)).sum().backward();
    });
    return leaf.grad().clone();
  };
  const at::Tensor alone = gradient(1);
  for (const int64_t workers : {2, 3, 7, 12})
    EXPECT_LT((gradient(workers) - alone).abs().max().item<float>(), 1e-6f) << workers;
  EXPECT_TRUE(gradient(2).equal(gradient(2)));
}

TEST(Workers, throw_what_a_share_threw) {
  const auto fails_at_the_end = [](int64_t, int64_t end) {
    if (end == 4) throw Error(ErrorCode::kIo, "a share", "failed");
  };
  EXPECT_THROW(in_shares(2, 4, fails_at_the_end), Error);
}

/// Folder of a model without weights, with the layers of patina-mini: its VAE is shallower, its denoiser a
/// quarter as wide.
fs::path small_model(const fs::path& folder) {
  fs::copy("models/patina-mini", folder, fs::copy_options::recursive);
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (entry.path().extension() == ".safetensors") fs::remove(entry.path());
  write_file(
      folder / "vae" / "config.json",
      R"({"block_out_channels": [8, 8, 8, 8], "layers_per_block": 1, "norm_num_groups": 2, "latent_channels": 8,
                 "mid_block_add_attention": false, "use_quant_conv": false, "use_post_quant_conv": false})");
  for (const char* component : {"unet", "controlnet_tile", "controlnet_normal"}) {
    const fs::path config = folder / component / "config.json";
    nlohmann::json values = nlohmann::json::parse(read_text_file(config));
    values.at("block_out_channels") = {16, 24, 40};
    if (values.contains("conditioning_embedding_out_channels"))
      values["conditioning_embedding_out_channels"] = {8, 8, 8, 16};
    write_file(config, values.dump());
  }
  return folder;
}

TEST(ColourPath, an_untrained_autoencoder_tells_colours_apart) {
  const test::TemporaryFolder folder;
  const diffusion::VaeConfig config =
      diffusion::read_vae_config(small_model(folder.path() / "model") / "vae");
  Parameters parameters("vae", 3, c10::kCPU);
  const auto vae = [&] {
    nn::WeightReader weights(parameters, at::kFloat);
    return diffusion::Vae(config, weights);
  };
  vae();
  lay_colour_path(parameters);
  // Quarters of red, green, blue and grey.
  at::Tensor picture = at::zeros({1, 3, 64, 64});
  for (int64_t i = 0; i < 3; ++i)
    picture[0][i].slice(0, 32 * (i / 2), 32 * (i / 2) + 32).slice(1, 32 * (i % 2), 32 * (i % 2) + 32) += 0.6;
  const c10::InferenceMode inference;
  const at::Tensor decoded = vae().decode(vae().encode(picture).mean);
  for (int64_t i = 0; i < 3; ++i) {
    const at::Tensor quarter = decoded[0]
                                   .slice(1, 32 * (i / 2) + 8, 32 * (i / 2) + 24)
                                   .slice(2, 32 * (i % 2) + 8, 32 * (i % 2) + 24)
                                   .mean({1, 2});
    EXPECT_EQ(quarter.argmax().item<int64_t>(), i) << quarter;
    EXPECT_GT((quarter[i] - quarter[(i + 1) % 3]).item<float>(), 0.1f);
  }
}

struct Weights {
  at::Tensor encoder, decoder;  // all numbers one behind the other
};
Weights weights_of(const fs::path& vae) {
  const nn::SafeTensors file(vae / "diffusion_pytorch_model.safetensors");
  std::vector<at::Tensor> encoder, decoder;
  for (const nn::TensorEntry& entry : file.tensors())
    (entry.name.find("encoder.") == 0 ? encoder : decoder)
        .push_back(nn::read_tensor(file, entry, at::kFloat).flatten().clone());
  return {at::cat(encoder), at::cat(decoder)};
}

TEST(Training, goes_from_pictures_to_a_model_that_edits) {
  const test::TemporaryFolder folder;
  const fs::path work = folder.path() / "work", model = small_model(folder.path() / "model");
  write_samples(work / "training", 4);
  write_samples(work / "held_out", 2);
  RunOptions run;
  run.minutes = 1.0 / 60;
  train_vae(work, model, {.run = run, .batch = 2, .side = 32});
  train_words(work, model, run);
  encode_latents(work, model, c10::kCPU);
  run.workers = 2;
  train_denoiser(work, model, {.run = run, .crops = 2, .views = 2, .grids = 1});
  const auto steps = [&] { return std::stoll(read_text_file(work / "denoiser.step")); };
  const auto first = steps();
  EXPECT_GT(first, 0);
  train_denoiser(work, model, {.run = run, .crops = 2, .views = 2, .grids = 1});
  EXPECT_GT(steps(), first);

  make_decoder_data(work, model, 1, 0);
  make_decoder_data(work, model, 2, 0);
  const DecoderData data(work, diffusion::read_vae_config(model / "vae"));
  EXPECT_EQ(data.size(), 2);
  const Weights before = weights_of(model / "vae");
  train_adversarially(work, model, {.run = run, .batch = 2, .side = 64});
  const Weights after = weights_of(model / "vae");
  EXPECT_TRUE(after.encoder.equal(before.encoder));  // and so the latents
  EXPECT_FALSE(after.decoder.equal(before.decoder));
  const auto finished = [&] { return std::stoll(read_text_file(work / "adversarial.step")); };
  const auto first_finished = finished();
  train_adversarially(work, model, {.run = run, .batch = 2, .side = 64});
  EXPECT_GT(finished(), first_finished);

  diffusion::ModelPaths paths;
  paths.model = model;
  const diffusion::Model trained(find_model_parts(paths), {});
  diffusion::EditInputs inputs;
  inputs.tile_views = inputs.normal_views = {Image(64, 64, 3)};
  inputs.noise = diffusion::scheduler_noise(7, 0, 8 * 8 * 8);
  diffusion::EditOptions options;
  options.prompt = "a band";
  options.num_steps = 2;
  const Image edited = edit_views(trained, inputs, options, {}, {})[0];
  EXPECT_EQ(edited.width, 64);
  for (const float value : edited.pixels) ASSERT_TRUE(std::isfinite(value));
}

TEST(VaeTraining, learns_goes_on_and_leaves_a_vae_that_loads) {
  const test::TemporaryFolder folder;
  const fs::path work = folder.path() / "work", model = folder.path() / "model";
  write_samples(work / "training", 4);
  write_samples(work / "held_out", 1);
  write_file(
      model / "vae" / "config.json",
      R"({"block_out_channels": [8, 8, 8], "layers_per_block": 1, "norm_num_groups": 4, "latent_channels": 4,
                 "mid_block_add_attention": false, "use_quant_conv": false, "use_post_quant_conv": false})");
  VaeTraining options;
  options.batch = 2, options.side = 32;
  options.run.minutes = 2.0 / 60;
  train_vae(work, model, options);
  const auto steps = [&] { return std::stoll(read_text_file(work / "vae.step")); };
  const auto first = steps();
  EXPECT_GT(first, 0);
  train_vae(work, model, options);
  EXPECT_GT(steps(), first);
  const diffusion::Vae vae(model / "vae", at::kFloat);
  EXPECT_EQ(vae.encode(at::zeros({1, 3, 32, 32})).mean.sizes(), at::IntArrayRef({1, 4, 8, 8}));
}

}  // namespace
}  // namespace patina::train_mini
