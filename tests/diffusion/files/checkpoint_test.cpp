// One model in every layout gives the same picture to the bit, and files that are not what they should be are
// refused by file and tensor.
#include "make_checkpoint/checkpoint.h"

#include "../refusals.h"
#include "../small_runs.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/check_model.h"
#include "patina/diffusion/files/weight_files.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;
namespace make = make_checkpoint;
using nn::ElementType;

const fs::path kTokenizer = test::data_dir() / "tiny-sd" / "tokenizer";

make::Model small_model(Family family, ElementType type = ElementType::kF32) {
  make::Model model;
  model.configs = make::configs_of(family, make::Size::kSmall, 897);
  model.type = type;
  return model;
}

std::vector<Image> run(const ModelPaths& paths, Dtype dtype = Dtype::kF32, bool low_memory = false) {
  const Model model(find_model_parts(paths), {dtype, low_memory});
  EditOptions options = test::short_options();
  options.num_steps = 2, options.strength = 1;
  options.negative_prompt = "clean";
  return edit_views(model, test::made_inputs(1, 64), options, {}, {});
}

class Checkpoint : public testing::TestWithParam<Family> {
 protected:
  fs::path file(const std::string& name) const { return folder_.path() / name; }
  /// Single file with ControlNets in cldm's names.
  ModelPaths write_single(const std::string& name, const make::Model& model) {
    make::write_single_file(file(name), model, {.vae = true, .text_encoder = true, .leftovers = true});
    make::write_controlnet(file("tile_" + name), model, make::Layout::kLdmPrefixed, false);
    make::write_controlnet(file("normal_" + name), model, make::Layout::kLdm, true);
    ModelPaths paths{file(name), {}, file("tile_" + name), file("normal_" + name)};
    paths.tokenizer = kTokenizer;
    paths.prediction = PredictionChoice::kEpsilon;
    return paths;
  }
  ModelPaths write_folder(const std::string& name, const make::Model& model,
                          make::FolderOptions options = {}) {
    options.tokenizer = kTokenizer;
    make::write_diffusers_folder(file(name), model, options);
    ModelPaths paths{file(name), {}, {}, {}};
    return paths;
  }
  static void expect_same(const std::vector<Image>& a, const std::vector<Image>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].pixels, b[i].pixels);
  }

  test::TemporaryFolder folder_;
};

TEST_P(Checkpoint, every_layout_gives_the_same_picture_to_the_bit) {
  const make::Model model = small_model(GetParam());
  // Both paddings are the end token here, as in SD 1.x; SD 2.x pads with token 0 from single files.
  ModelPaths folder = write_folder("folder", model);
  if (GetParam() == Family::kSd2) {
    const std::string map = read_text_file(file("folder") / "tokenizer" / "tokenizer_config.json");
    std::string padded = map;
    padded.replace(padded.find("\"pad_token\": \"<|endoftext|>\""), 28, "\"pad_token\": \"!\"");
    write_file(file("folder") / "tokenizer" / "tokenizer_config.json", padded);
    fs::remove(file("folder") / "tokenizer" / "special_tokens_map.json");
  }
  const std::vector<Image> expected = run(folder);
  EXPECT_NE(expected.front().pixels.front(), expected.front().pixels.back());

  const ModelPaths single = write_single("single.safetensors", model);
  expect_same(run(single), expected);

  // The components of one layout in the place of those of the other.
  make::write_vae(file("vae.safetensors"), model, make::Layout::kLdm);
  ModelPaths exchanged = folder;
  exchanged.vae = file("vae.safetensors");
  exchanged.controlnet_tile = single.controlnet_tile;
  make::write_controlnet(file("normal.safetensors"), model, make::Layout::kDiffusers, true);
  exchanged.controlnet_normal = file("normal.safetensors");
  expect_same(run(exchanged), expected);

  // Without VAE and text encoder inside.
  make::write_single_file(file("bare.safetensors"), model, {.vae = false, .text_encoder = false});
  ModelPaths bare = single;
  bare.model = file("bare.safetensors");
  expect_in("holds no text encoder; name one", failure([&] { check_model(find_model_parts(bare)); }));
  bare.text_encoder = file("folder") / "text_encoder";
  expect_in("holds no VAE; name one", failure([&] { check_model(find_model_parts(bare)); }));
  bare.vae = single.model;
  expect_same(run(bare), expected);
}

TEST_P(Checkpoint, half_mixed_and_sharded_weights_give_the_same_picture_to_the_bit) {
  make::Model model = small_model(GetParam(), ElementType::kF16);
  model.mixed = true;
  const ModelPaths single = write_single("mixed.safetensors", model);
  const auto with_tokenizer = [&](ModelPaths paths) {
    // The padding is that of a single file, so that both read the same text.
    paths.text_encoder = single.model;
    return paths;
  };
  const std::vector<Image> expected = run(single);
  expect_same(run(with_tokenizer(write_folder("variant", model, {.variant = "fp16"}))), expected);
  expect_same(run(with_tokenizer(write_folder("sharded", model, {.num_shards = 3}))), expected);
  expect_same(run(single, Dtype::kBf16), run(with_tokenizer({file("sharded"), {}, {}, {}}), Dtype::kBf16));
}

TEST_P(Checkpoint, networks_that_are_read_for_each_use_give_the_same_picture) {
  // As stored, so that the tensors lie in the file, and converted; with LoRAs of both networks.
  const make::Model model = small_model(GetParam(), ElementType::kBF16);
  ModelPaths paths = write_single("single.safetensors", model);
  make::write_lora(file("lora.safetensors"), model);
  paths.loras = {{file("lora.safetensors"), 0.7f}};
  const auto pictures = [&](Dtype dtype, bool low_memory) { return run(paths, dtype, low_memory); };
  expect_same(pictures(Dtype::kF32, true), pictures(Dtype::kF32, false));
  // With low memory convolutions are plain sums, with enough of it Winograd's: in bf16 they round
  // differently.
  const std::vector<Image> low = pictures(Dtype::kBf16, true), enough = pictures(Dtype::kBf16, false);
  for (size_t i = 0; i < low.size(); ++i) EXPECT_GE(test::psnr(low[i], enough[i]), 35) << "picture " << i;
}

INSTANTIATE_TEST_SUITE_P(Families, Checkpoint, testing::Values(Family::kSd1, Family::kSd2),
                         [](const auto& test_info) {
                           return test_info.param == Family::kSd1 ? "sd1" : "sd2";
                         });

/// Files whose tensors are shapes alone.
class BrokenCheckpoint : public testing::Test {
 protected:
  BrokenCheckpoint() {
    make::Model model = small_model(Family::kSd1, ElementType::kF16);
    model.empty = true;
    make::write_single_file(path_, model);
  }
  void edit(const std::function<void(std::vector<nn::TensorPlan>&)>& change) const {
    std::vector<nn::TensorPlan> plans;
    const nn::SafeTensors file(path_);
    for (const nn::TensorEntry& entry : file.tensors())
      plans.push_back({entry.name, entry.type, entry.shape});
    change(plans);
    nn::write_safetensors(path_, plans, nullptr);
  }
  std::string check() const {
    return failure([&] { check_path(path_); });
  }

  test::TemporaryFolder folder_;
  const fs::path path_ = folder_.path() / "model.safetensors";
};

TEST_F(BrokenCheckpoint, is_none_as_written) {
  const std::string text = check_path(path_);
  expect_in("checkpoint, Stable Diffusion 1.x, f16", text);
  expect_in("U-Net         686 tensors", text);
  expect_in("LDM's names", text);
}

TEST_F(BrokenCheckpoint, a_missing_tensor_is_named_as_the_file_would_name_it) {
  edit([](auto& plans) {
    std::erase_if(plans, [](const auto& plan) {
      return plan.name == "model.diffusion_model.middle_block.1.proj_out.weight";
    });
  });
  expect_in("model.safetensors: 1 tensors are missing: model.diffusion_model.middle_block.1.proj_out.weight",
            check());
}

TEST_F(BrokenCheckpoint, is_told_before_the_first_use) {
  edit([](std::vector<nn::TensorPlan>& plans) {
    std::erase_if(plans, [](const nn::TensorPlan& plan) {
      return plan.name == "first_stage_model.decoder.conv_in.weight";
    });
  });
  const fs::path control = folder_.path() / "control.safetensors";
  make::write_controlnet(control, small_model(Family::kSd1), make::Layout::kLdm, false);
  ModelPaths paths{path_, {}, control, control};
  paths.tokenizer = kTokenizer;
  expect_in("first_stage_model.decoder.conv_in.weight", failure([&] {
              const Model model(find_model_parts(paths), {Dtype::kF32, /*low_memory=*/true});
            }));
}

TEST_F(BrokenCheckpoint, a_wrong_shape_is_named_with_what_was_expected) {
  edit([](auto& plans) {
    for (auto& plan : plans) {
      if (plan.name == "first_stage_model.decoder.up.0.block.0.conv1.weight") plan.shape = {32, 32, 1, 1};
    }
  });
  expect_in(
      "first_stage_model.decoder.up.0.block.0.conv1.weight (expected [32, 32, 3, 3], found [32, 32, 1, 1])",
      check());
}

TEST_F(BrokenCheckpoint, a_tensor_without_a_place_is_named) {
  edit([](auto& plans) {
    plans.push_back({"model.diffusion_model.output_blocks.3.5.weight", ElementType::kF16, {4}});
  });
  expect_in("do not belong to a network of this configuration: output_blocks.3.5.weight", check());
}

TEST_F(BrokenCheckpoint, a_truncated_file_names_the_first_tensor_that_is_cut) {
  fs::resize_file(path_, fs::file_size(path_) - 1000);
  expect_in("tensor 'cond_stage_model", check());
  expect_in("truncated", check());
}

TEST_F(BrokenCheckpoint, weights_of_integers_are_refused) {
  edit([](auto& plans) {
    for (auto& plan : plans) {
      if (plan.name == "model.diffusion_model.out.2.weight") plan.type = ElementType::kI8;
    }
  });
  expect_in("model.diffusion_model.out.2.weight holds I8, expected weights of F32, F16 or BF16", check());
}

TEST_F(BrokenCheckpoint, models_of_other_tasks_are_named) {
  edit([](auto& plans) {
    for (auto& plan : plans) {
      if (plan.name == "model.diffusion_model.input_blocks.0.0.weight") plan.shape[1] = 9;
    }
  });
  expect_in("is an inpainting model", failure([&] { check_model(find_model_parts({path_, {}, {}, {}})); }));
}

TEST_F(BrokenCheckpoint, infinities_are_named) {
  const std::vector<float> values{1, INFINITY, NAN, 4};
  const std::vector<nn::TensorEntry> tensors{
      {"<word>", ElementType::kF32, {1, 4}, {reinterpret_cast<const uint8_t*>(values.data()), 16}}};
  nn::write_safetensors(path_, tensors);
  expect_in("hold infinities or NaN: <word> (2 of 4)", check());
}

TEST_F(BrokenCheckpoint, other_families_are_refused_by_name) {
  const auto refusal_of = [&](const std::string& tensor) {
    const std::vector<nn::TensorPlan> plans{{tensor, ElementType::kF16, {4, 4}}};
    nn::write_safetensors(path_, plans, nullptr);
    return check();
  };
  expect_in("a Stable Diffusion XL checkpoint", refusal_of("model.diffusion_model.label_emb.0.0.weight"));
  expect_in("a Stable Diffusion XL checkpoint", refusal_of("conditioner.embedders.1.model.ln_final.weight"));
  expect_in("a Stable Diffusion 3 checkpoint",
            refusal_of("model.diffusion_model.joint_blocks.0.x_block.attn.qkv.weight"));
  expect_in("a Flux transformer", refusal_of("double_blocks.0.img_attn.qkv.weight"));
  expect_in("a T2I adapter", refusal_of("adapter.body.0.block1.weight"));
  expect_in("a LoRA for Stable Diffusion XL", refusal_of("lora_te2_text_model.lora_down.weight"));
  expect_in("holds no network that patina knows", refusal_of("layers.0.attention.wq.weight"));
}

TEST_F(BrokenCheckpoint, an_index_that_leads_out_of_its_folder_is_refused) {
  const fs::path index = folder_.path() / "model.safetensors.index.json";
  write_file(index, std::string(R"({"weight_map": {"a": "../other.safetensors"}})"));
  expect_in("expected the name of a file beside the index", failure([&] { open_weight_files(index); }));
  write_file(index, std::string(R"({"weight_map": {"a": "gone.safetensors"}})"));
  expect_in("gone.safetensors: is missing", failure([&] { open_weight_files(index); }));
  write_file(index, std::string(R"({"weight_map": {"a": "model.safetensors"}})"));
  expect_in("lacks the tensor 'a'", failure([&] { open_weight_files(index); }));
}

}  // namespace
}  // namespace patina::diffusion
