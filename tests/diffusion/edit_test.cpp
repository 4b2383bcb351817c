// The whole way through the facade: equal to the reference's ControlNet image-to-image, resumable to the bit,
// honest about its inputs.
#include "patina/diffusion/edit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "../support.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/edit_run.h"
#include "patina/diffusion/fine_detail.h"
#include "patina/diffusion/networks/vae.h"
#include "patina/nn/safetensors.h"
#include "small_runs.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

std::vector<float> floats(const nn::SafeTensors& file, const std::string& name) {
  const nn::TensorEntry* entry = file.find(name);
  if (!entry) throw std::runtime_error("golden file lacks " + name);
  std::vector<float> values(entry->bytes.size() / sizeof(float));
  std::memcpy(values.data(), entry->bytes.data(), entry->bytes.size());
  return values;
}

/// [1,3,H,W] -> an image.
Image image_of(const nn::SafeTensors& file, const std::string& name) {
  const std::vector<float> values = floats(file, name);
  const std::vector<int64_t> shape = file.find(name)->shape;
  Image image(static_cast<int>(shape[3]), static_cast<int>(shape[2]), 3);
  for (size_t c = 0; c < 3; ++c) {
    for (size_t i = 0; i < image.num_pixels(); ++i)
      image.pixels[3 * i + c] = values[c * image.num_pixels() + i];
  }
  return image;
}

using test::made_inputs, test::max_difference, test::same_place_bias, test::short_options, test::tiny_model;

std::vector<Image> run(const EditInputs& inputs, const EditOptions& options, const EditHooks& hooks = {},
                       const Progress& progress = {}) {
  return edit_views(tiny_model(), inputs, options, hooks, progress);
}

TEST(Detail, without_bias_it_is_the_reference_controlnet_image_to_image) {
  const nn::SafeTensors golden(test::data_dir() / "golden" / "e2e_img2img_ddim6.safetensors");
  EditInputs inputs;
  inputs.start_views = {image_of(golden, "init_image_01")};
  inputs.tile_views = {image_of(golden, "cond_tile_01")};
  inputs.normal_views = {image_of(golden, "cond_normal_01")};
  inputs.noise = floats(golden, "noise");
  EditOptions options;
  options.prompt = golden.metadata().at("prompt");
  options.negative_prompt = golden.metadata().at("negative_prompt");
  options.num_steps = 6, options.strength = 0.8f;
  options.tile_scale = 0.8f, options.normal_scale = 0.7f;
  options.scheduler = Scheduler::kDdim;
  options.fine_detail = 0;  // which the reference has not
  const std::vector<Image> views = run(inputs, options);
  ASSERT_EQ(views.size(), 1u);
  EXPECT_LT(max_difference(views[0], image_of(golden, "decoded_01")), 5e-4 + 1e-4);
}

TEST(Detail, parts_with_the_prompt_s_own_words_change_nothing_and_others_do) {
  EditInputs inputs = made_inputs(2, 64);
  EditOptions options = short_options();
  options.negative_prompt = "clean";
  const std::vector<Image> plain = run(inputs, options);
  for (size_t v = 0; v < inputs.tile_views.size(); ++v) {
    Image halves(64, 64, 2, 0.0f);
    for (int y = 0; y < 64; ++y)
      for (int x = 0; x < 64; ++x) halves.at(x, y)[y < 20 ? 0 : 1] = x < 40 ? 1.0f : 0.25f;
    inputs.part_views.push_back(halves);
  }
  options.part_prompts = {{options.prompt}, {options.prompt, "clean"}};
  const std::vector<Image> same = run(inputs, options);
  for (size_t v = 0; v < plain.size(); ++v) EXPECT_LT(max_difference(plain[v], same[v]), 1e-3);
  options.part_prompts[1].prompt = "a wooden box under green moss, (snow:1.3)";
  EXPECT_GT(max_difference(plain[0], run(inputs, options)[0]), 1e-2);
  options.part_prompts[1] = {options.prompt, "a wooden box"};
  EXPECT_GT(max_difference(plain[0], run(inputs, options)[0]), 1e-2);

  inputs.part_views.pop_back();
  EXPECT_THROW(run(inputs, options), Error);
}

TEST(Detail, an_exemplar_that_no_pixel_looks_at_changes_nothing_and_a_weightier_one_more) {
  EditInputs inputs = made_inputs(2, 64);
  const EditOptions options = short_options();
  const std::vector<Image> plain = run(inputs, options);
  Image picture(64, 64, 3);
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = i % 3 == 0 ? 0.9f : 0.1f + 0.2f * static_cast<float>(i % 7 == 0);
  inputs.exemplars.push_back({picture, std::vector<Image>(4, Image(64, 64, 1, 0.0f))});
  EXPECT_EQ(max_difference(plain[0], run(inputs, options)[0]), 0);
  double last = 0;
  for (const float weight : {0.05f, 1.0f}) {
    inputs.exemplars[0].view_weights.assign(4, Image(64, 64, 1, weight));
    const double moved = max_difference(plain[0], run(inputs, options)[0]);
    EXPECT_GT(moved, last + 1e-3);
    last = moved;
  }

  std::vector<Checkpoint> checkpoints;
  EditHooks keep;
  keep.on_checkpoint = [&](const Checkpoint& checkpoint) { checkpoints.push_back(checkpoint); };
  const std::vector<Image> whole = run(inputs, options, keep);
  EditHooks resume;
  resume.resume = checkpoints[1];
  EXPECT_EQ(max_difference(whole[0], run(inputs, options, resume)[0]), 0);

  inputs.exemplars[0].picture = Image(32, 64, 3);
  EXPECT_THROW(run(inputs, options), Error);
}

TEST(Detail, a_resumed_run_gives_the_same_bytes) {
  const EditInputs inputs = made_inputs(2, 64);
  for (const Scheduler scheduler : {Scheduler::kUniPc, Scheduler::kPndm, Scheduler::kEulerAncestral}) {
    std::vector<Checkpoint> checkpoints;
    EditHooks keep;
    keep.on_checkpoint = [&](const Checkpoint& checkpoint) { checkpoints.push_back(checkpoint); };
    const std::vector<Image> whole = run(inputs, short_options(scheduler), keep);
    ASSERT_GE(checkpoints.size(), 4u);
    EditHooks resume;
    resume.resume = checkpoints[1];
    const std::vector<Image> resumed = run(inputs, short_options(scheduler), resume);
    for (size_t i = 0; i < whole.size(); ++i)
      EXPECT_EQ(whole[i].pixels, resumed[i].pixels) << static_cast<int>(scheduler);
  }
}

TEST(Detail, refuses_checkpoints_that_are_damaged_or_of_another_run) {
  const EditInputs inputs = made_inputs(1, 64);
  Checkpoint last;
  EditHooks keep;
  keep.on_checkpoint = [&](const Checkpoint& checkpoint) { last = checkpoint; };
  run(inputs, short_options(), keep);
  EditHooks resume;
  resume.resume = last;
  resume.resume->bytes.pop_back();
  EXPECT_THROW(run(inputs, short_options(), resume), Error);
  resume.resume = last;
  EXPECT_THROW(run(made_inputs(2, 64), short_options(), resume), Error);
}

TEST(Detail, stops_between_steps_when_asked_and_reports_every_step) {
  std::vector<double> done;
  bool stop = false;
  Progress progress;
  progress.on_update = [&](std::string_view task, double at, double total) {
    if (task != "detail") return;
    done.push_back(at);
    EXPECT_EQ(total, 4);
    stop = at == 2;
  };
  progress.stop_requested = [&] { return stop; };
  try {
    run(made_inputs(1, 64), short_options(), {}, progress);
    FAIL() << "did not stop";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInterrupted);
  }
  EXPECT_EQ(done, (std::vector<double>{0, 1, 2}));
}

TEST(Detail, a_bias_of_zero_is_none_and_another_is_felt) {
  EditInputs inputs = made_inputs(2, 64);
  const std::vector<Image> plain = run(inputs, short_options());
  inputs.bias_levels = same_place_bias(2, 8, 2);
  EditOptions options = short_options();
  EXPECT_EQ(run(inputs, options)[0].pixels, plain[0].pixels);
  options.bias_weight = 4;
  const std::vector<Image> additive = run(inputs, options);
  EXPECT_GT(max_difference(additive[0], plain[0]), 1e-3);
  options.bias_scaling = BiasScaling::kPaper;
  EXPECT_GT(max_difference(run(inputs, options)[0], additive[0]), 1e-3);
}

TEST(Detail, the_bias_of_controlnets_is_felt_only_where_it_is_asked_for) {
  EditInputs inputs = made_inputs(2, 64);
  inputs.bias_levels = same_place_bias(2, 8, 2);
  EditOptions options = short_options();
  options.num_steps = 2, options.strength = 1;
  const std::vector<Image> plain = run(inputs, options);
  options.bias_controlnet = true;
  EXPECT_EQ(run(inputs, options)[0].pixels, plain[0].pixels) << "with a weight of 0";
  options.bias_weight = 4;
  const std::vector<Image> both = run(inputs, options);
  options.bias_controlnet = false;
  EXPECT_GT(max_difference(run(inputs, options)[0], both[0]), 1e-4);
}

TEST(Detail, options_are_felt) {
  const EditInputs inputs = made_inputs(1, 64);
  const Image plain = run(inputs, short_options())[0];
  const auto differs = [&](const std::function<void(EditOptions&)>& change) {
    EditOptions options = short_options();
    change(options);
    return max_difference(run(inputs, options)[0], plain) > 1e-4;
  };
  EXPECT_TRUE(differs([](EditOptions& o) { o.prompt = "a mossy stone"; }));
  EXPECT_TRUE(differs([](EditOptions& o) { o.negative_prompt = "blurry"; }));
  EXPECT_TRUE(differs([](EditOptions& o) { o.guidance_scale = 1; }));
  EXPECT_FALSE(differs([](EditOptions& o) { o.guidance_scale = 7.5f; }));  // what auto is for this model
  EXPECT_TRUE(differs([](EditOptions& o) { o.strength = 0.4f; }));
  EXPECT_TRUE(differs([](EditOptions& o) { o.tile_scale = 0; }));
  EXPECT_TRUE(differs([](EditOptions& o) { o.normal_scale = 0.5f; }));
  EXPECT_TRUE(differs([](EditOptions& o) { o.fine_detail = 0.5f; }));
  EXPECT_TRUE(differs([](EditOptions& o) { o.scheduler = Scheduler::kEuler; }));
}

TEST(Detail, guidance_says_the_same_in_one_batch_and_in_two) {
  const c10::InferenceMode inference;
  EditInputs inputs = made_inputs(2, 128);
  inputs.bias_levels = same_place_bias(2, 16, 2);
  EditOptions options = short_options();
  options.bias_weight = 1, options.bias_controlnet = true, options.guidance_scale = 7.5f;
  const std::unique_ptr<EditRun> run = start_edit(tiny_model(), inputs, options, std::nullopt, {});
  const at::Tensor latents = at::from_blob(run->state.latents.data(), run->shape, at::kFloat);
  run->denoiser.one_batch = true;
  const Guided at_once = run->denoiser(latents, 601);
  run->denoiser.one_batch = false;
  const Guided in_turn = run->denoiser(latents, 601);
  EXPECT_LT((at_once.unconditional - in_turn.unconditional).abs().max().item<double>(), 1e-5);
  EXPECT_LT((at_once.conditional - in_turn.conditional).abs().max().item<double>(), 1e-5);
  EXPECT_LT((at_once.guided - in_turn.guided).abs().max().item<double>(), 1e-4);
  EXPECT_GT((at_once.conditional - at_once.unconditional).abs().max().item<double>(), 1e-3);
}

TEST(Detail, a_models_own_guidance_holds_where_none_is_given) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "model";
  fs::copy(test::data_dir() / "tiny-sd", path, fs::copy_options::recursive);
  write_file(path / "model_index.json",
             std::string(R"({"_class_name": "StableDiffusionPipeline", "_negative_prompt": "blurry",
                             "_guidance_scale": 3})"));
  const Model with_own(find_model_parts({path, {}, {}, {}}), {Dtype::kF32});
  const EditInputs inputs = made_inputs(1, 64);
  const auto edited = [&](const Model& model, std::optional<std::string> negative_prompt, float scale) {
    EditOptions options = short_options();
    options.guidance_scale = scale;
    options.negative_prompt = std::move(negative_prompt);
    return edit_views(model, inputs, options, {}, {})[0].pixels;
  };
  constexpr float kAuto = kAutoGuidanceScale;
  EXPECT_EQ(edited(with_own, std::nullopt, kAuto), edited(tiny_model(), "blurry", 3));
  EXPECT_EQ(edited(with_own, "", 7.5f), edited(tiny_model(), std::nullopt, kAuto));
  EXPECT_EQ(edited(with_own, "a mossy stone", kAuto), edited(tiny_model(), "a mossy stone", 3));
  EXPECT_EQ(guidance_of(with_own, {}).scale, 3);
  EXPECT_EQ(guidance_of(with_own, {}).negative_prompt, "blurry");
  EditOptions unguided;
  unguided.guidance_scale = 1;
  EXPECT_EQ(guidance_of(with_own, unguided).negative_prompt, "");

  write_file(path / "model_index.json", std::string(R"({"_guidance_scale": 0})"));
  try {
    const Model refused(find_model_parts({path, {}, {}, {}}), {Dtype::kF32});
    ADD_FAILURE() << "took a guidance scale of 0";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("_guidance_scale is 0, expected 1 to 50"), std::string::npos)
        << error.what();
  }
}

TEST(Detail, what_the_vae_loses_of_the_renders_comes_back) {
  const EditInputs inputs = made_inputs(1, 64);
  const c10::InferenceMode inference;
  const Vae vae(test::data_dir() / "tiny-sd" / "vae", at::kFloat);
  const at::Tensor render = tensor_from_image(inputs.tile_views[0]);
  const at::Tensor lost =
      (render - (0.5 * vae.decode(vae.encode(2 * render - 1).mean) + 0.5)).permute({0, 2, 3, 1}).contiguous();
  const float* loss = lost.data_ptr<float>();
  for (const auto& [asked, tile_scale, share] :
       {std::array{1.0f, 1.0f, 1.0f}, {0.5f, 1.0f, 0.5f}, {1.0f, 0.4f, 0.4f}, {1.0f, 1.5f, 1.0f}}) {
    EditOptions options = short_options();
    options.tile_scale = tile_scale;
    options.fine_detail = 0;
    const Image without = run(inputs, options)[0];
    options.fine_detail = asked;
    const Image with = run(inputs, options)[0];
    const auto light = [](const float* rgb) {
      return 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
    };
    const auto clamped = [](const float* rgb) {
      return *std::min_element(rgb, rgb + 3) <= 0 || *std::max_element(rgb, rgb + 3) >= 1;
    };
    int compared = 0;
    for (size_t i = 0; i < with.pixels.size(); i += 3) {
      const float *before = &without.pixels[i], *after = &with.pixels[i];
      if (clamped(before) || clamped(after)) continue;  // what it would have been is not known
      ASSERT_NEAR(light(after) - light(before), share * light(loss + i), 1e-5f) << i;
      ++compared;
    }
    EXPECT_GT(compared, 1000);
  }
}

TEST(FineDetail, light_comes_back_whole_and_colour_where_the_edit_kept_it) {
  const c10::InferenceMode inference;
  const Vae vae(test::data_dir() / "tiny-sd" / "vae", at::kFloat);
  const at::Tensor render = tensor_from_image(made_inputs(1, 64).tile_views[0]);
  const at::Tensor kept = 0.5 * vae.decode(vae.encode(2 * render - 1).mean) + 0.5, lost = render - kept;
  const auto farthest = [](const at::Tensor& a, const at::Tensor& b) {
    return (a - b).abs().max().item<double>();
  };
  const at::Tensor darker = kept - 0.3;
  EXPECT_LT(farthest(fine_detail(vae, render, kept), lost), 1e-6);
  EXPECT_LT(farthest(fine_detail(vae, render, darker), lost), 1e-6) << "no colour has changed";

  at::Tensor half = kept.clone();  // the right half turns red
  half.slice(3, 32).select(1, 0) += 2;
  const at::Tensor added = fine_detail(vae, render, half);
  const at::Tensor light =
      0.2126 * lost.select(1, 0) + 0.7152 * lost.select(1, 1) + 0.0722 * lost.select(1, 2);
  EXPECT_LT(farthest(added.slice(3, 0, 20), lost.slice(3, 0, 20)), 1e-6);
  for (int64_t channel = 0; channel < 3; ++channel)
    EXPECT_LT(farthest(added.select(1, channel).slice(2, 44), light.slice(2, 44)), 1e-6);
  EXPECT_GT(farthest(lost.select(1, 0), light), 0.01) << "there is colour to be lost";
}

TEST(Detail, predicted_memory_follows_views_guidance_and_what_stays_in_memory) {
  EditOptions options = short_options();
  options.guidance_scale = 1;
  const EditMemory one = predict_memory(tiny_model(), 4, 128, 128, options),
                   four = predict_memory(tiny_model(), 4, 256, 256, options);
  EXPECT_GT(one.activations, 0);
  EXPECT_EQ(four.activations, 4 * one.activations);
  EXPECT_EQ(four.weights, one.weights);
  options.guidance_scale = 7.5f;
  EXPECT_EQ(predict_memory(tiny_model(), 4, 128, 128, options).activations, 2 * one.activations);
  const int64_t guided = predict_memory(tiny_model(), 4, 1024, 1024, options).activations;
  EXPECT_GT(guided, 64 * one.activations) << "large maps one prompt after the other";
  EXPECT_LT(guided, 2 * 64 * one.activations);

  const Model streamed(find_model_parts({test::data_dir() / "tiny-sd", {}, {}, {}}),
                       {Dtype::kF32, /*low_memory=*/true});
  EXPECT_LT(predict_memory(streamed, 4, 128, 128, options).weights, one.weights);
}

TEST(Detail, bf16_stays_near_f32) {
  const Model model(find_model_parts({test::data_dir() / "tiny-sd", {}, {}, {}}), {Dtype::kBf16});
  const EditInputs inputs = made_inputs(1, 64);
  EditOptions options = short_options();
  options.num_steps = 20, options.strength = 1;
  for (const float guidance_scale : {1.0f, 7.5f}) {
    options.guidance_scale = guidance_scale;
    const Image f32 = run(inputs, options)[0], bf16 = edit_views(model, inputs, options, {}, {})[0];
    const double psnr = test::psnr(f32, bf16);
    RecordProperty("psnr_at_guidance_" + std::to_string(static_cast<int>(guidance_scale)),
                   std::to_string(psnr));
    EXPECT_GT(psnr, 35) << "guidance " << guidance_scale;
  }
}

TEST(Detail, refuses_inputs_that_do_not_fit_and_says_what_would) {
  const auto message = [](const EditInputs& inputs, const EditOptions& options) {
    try {
      run(inputs, options);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUsage) << error.what();
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const EditInputs good = made_inputs(2, 64);
  EditInputs inputs = good;
  inputs.tile_views.pop_back();
  EXPECT_NE(message(inputs, short_options()).find("there are 3 images, expected 4"), std::string::npos);
  inputs = good;
  inputs.normal_views[2] = Image(64, 32, 3);
  EXPECT_NE(message(inputs, short_options()).find("64 × 32"), std::string::npos);
  inputs = good;
  inputs.noise.pop_back();
  EXPECT_NE(message(inputs, short_options()).find("expected 1024"), std::string::npos);
  inputs = good;
  inputs.bias_levels = same_place_bias(2, 16, 2);
  EXPECT_NE(message(inputs, short_options()).find("no resolution of the U-Net"), std::string::npos);
  inputs = good;
  for (Image& view : inputs.tile_views) view = Image(60, 60, 3);
  EXPECT_NE(message(inputs, short_options()).find("multiples of 8"), std::string::npos);
  EditOptions options = short_options();
  options.strength = 1.5f;
  EXPECT_NE(message(good, options).find("strength"), std::string::npos);
  options = short_options();
  options.guidance_scale = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(message(good, options).find("guidance scale"), std::string::npos);
}

}  // namespace
}  // namespace patina::diffusion
