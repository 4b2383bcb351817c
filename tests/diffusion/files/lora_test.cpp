// LoRAs: merged as by hand in f64, the same in every naming, and refused where they do not belong.
#include "patina/diffusion/files/lora.h"

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "make_checkpoint/checkpoint.h"
#include "patina/base/error.h"
#include "patina/diffusion/files/embedding.h"
#include "patina/diffusion/networks/component.h"
#include "support.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;
namespace make = make_checkpoint;
using make::LoraNaming;

class Lora : public testing::Test {
 protected:
  Lora() {
    model_.configs = make::configs_of(Family::kSd1, make::Size::kSmall, 897);
    make::write_single_file(path("model"), model_);
    unet_ = open_unet(path("model"));
    text_ = open_text_encoder(path("model"));
  }
  fs::path path(const std::string& name) const { return folder_.path() / (name + ".safetensors"); }
  LoraSet match(const std::string& name, float weight = 1) const {
    const std::vector<LoraChoice> choices{{path(name), weight}};
    return match_loras(choices, unet_, texts());
  }
  std::vector<const TensorTable*> texts() const { return {&text_.table}; }
  std::string refusal(const std::string& name) const {
    try {
      match(name);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }
  void expect_refusal(const std::string& name, const std::string& part) const {
    const std::string found = refusal(name);
    EXPECT_NE(found.find(part), std::string::npos) << "expected: " << part << "\n   found: " << found;
  }
  at::Tensor plain(const TensorTable& table, const std::string& name,
                   at::ScalarType type = at::kFloat) const {
    const StoredTensor& stored = table.tensors.at(name);
    return nn::read_tensor(*stored.file, stored.entry, type);
  }
  at::Tensor merged(const TensorTable& table, const LoraDeltas& deltas, const std::string& name) const {
    return TableWeights(table, &deltas).find(name, table.tensors.at(name).entry.shape, at::kFloat);
  }

  c10::InferenceMode inference_;
  test::TemporaryFolder folder_;
  make::Model model_;
  UNetPart unet_;
  TextEncoderPart text_;
};

const std::string kLinear = "up_blocks.1.attentions.2.transformer_blocks.0.attn2.to_k.weight";
const std::string kConvolution = "down_blocks.1.resnets.0.conv1.weight";

TEST_F(Lora, is_merged_as_by_hand_in_f64) {
  make::write_lora(path("lora"), model_, {.rank = 3, .alpha = 1.5, .convolutions = true});
  constexpr float kWeight = 0.7f;
  const LoraSet set = match("lora", kWeight);
  const nn::SafeTensors file(path("lora"));
  const auto part = [&](const std::string& name) {
    return nn::read_tensor(file, *file.find(name), at::kDouble);
  };
  for (const auto& [name, stored] :
       {std::pair(kLinear, "lora_unet_up_blocks_1_attentions_2_transformer_blocks_0_attn2_to_k"),
        std::pair(kConvolution, "lora_unet_down_blocks_1_resnets_0_conv1")}) {
    const at::Tensor weight = plain(unet_.table, name, at::kDouble);
    const at::Tensor up = part(std::string(stored) + ".lora_up.weight").reshape({weight.size(0), 3}),
                     down = part(std::string(stored) + ".lora_down.weight").reshape({3, -1});
    const double scale = static_cast<double>(kWeight) * 1.5 / 3;
    const at::Tensor expected = weight + scale * at::matmul(up, down).reshape(weight.sizes());
    const at::Tensor found = merged(unet_.table, set.unet, name).to(at::kDouble);
    // Roundings in f32: a product of length 3, a factor and its own rounding, a sum.
    const at::Tensor magnitude =
        weight.abs() + 8 * scale * at::matmul(up.abs(), down.abs()).reshape(weight.sizes());
    EXPECT_TRUE(at::all((found - expected).abs() <= 0x1p-24 * magnitude).item<bool>()) << name;
    EXPECT_GT((found - weight).abs().max().item<double>(), 1e-3);
  }
  const std::string projection = "text_model.encoder.layers.1.self_attn.v_proj.weight";
  EXPECT_TRUE(set.text_encoders[0].contains(projection));
  EXPECT_FALSE(
      at::equal(merged(text_.table, set.text_encoders[0], projection), plain(text_.table, projection)));
}

TEST_F(Lora, is_the_same_in_every_naming) {
  make::write_lora(path("kohya"), model_, {.rank = 4, .alpha = 4});
  const LoraSet expected = match("kohya");
  for (const LoraNaming naming : {LoraNaming::kKohyaLdm, LoraNaming::kPeft, LoraNaming::kDiffusersOld,
                                  LoraNaming::kDiffusersProcessor}) {
    // The first attention processors knew the attention's four projections alone.
    if (naming == LoraNaming::kDiffusersProcessor) {
      make::write_lora(path("same"), model_, {.naming = naming, .rank = 4, .text_encoder = false});
    } else {
      make::write_lora(path("same"), model_, {.naming = naming, .rank = 4, .alpha = 4});
      EXPECT_EQ(match("same").text_encoders[0].size(), expected.text_encoders[0].size());
    }
    const LoraSet found = match("same");
    ASSERT_EQ(found.unet.size(), expected.unet.size());
    for (const auto& [name, deltas] : expected.unet) {
      EXPECT_TRUE(at::equal(merged(unet_.table, found.unet, name), merged(unet_.table, expected.unet, name)))
          << name;
    }
  }
}

TEST_F(Lora, a_core_between_the_factors_is_contracted) {
  make::write_lora(path("lora"), model_, {.rank = 2, .alpha = 2, .convolutions = true, .cores = true});
  const LoraSet set = match("lora");
  const LoraDelta& delta = set.unet.at(kConvolution).front();
  ASSERT_TRUE(delta.mid.has_value());
  const auto read = [](const StoredTensor& t) { return nn::read_tensor(*t.file, t.entry, at::kDouble); };
  const at::Tensor weight = plain(unet_.table, kConvolution, at::kDouble), mid = read(*delta.mid),
                   up = read(delta.up).reshape({-1, 2}), down = read(delta.down).reshape({2, -1});
  at::Tensor expected = weight.clone();
  for (int64_t y = 0; y < 3; ++y) {
    for (int64_t x = 0; x < 3; ++x)
      expected.select(3, x).select(2, y) += at::matmul(at::matmul(up, mid.select(3, x).select(2, y)), down);
  }
  const at::Tensor found = merged(unet_.table, set.unet, kConvolution).to(at::kDouble);
  EXPECT_LT((found - expected).abs().max().item<double>(), 1e-5);
}

TEST_F(Lora, takes_the_alpha_that_diffusers_keeps_in_the_metadata) {
  make::write_lora(path("plain"), model_, {.naming = LoraNaming::kPeft, .rank = 4});
  const nn::SafeTensors plain(path("plain"));
  nn::write_safetensors(
      path("scaled"), plain.tensors(),
      {{"lora_adapter_metadata",
        R"({"unet.lora_alpha": 12, "unet.r": 4, "text_encoder.lora_alpha": 2, "text_encoder.r": 4})"}});
  const LoraSet set = match("scaled");
  EXPECT_DOUBLE_EQ(set.unet.at(kLinear).front().scale, 3.0);
  EXPECT_DOUBLE_EQ(set.text_encoders[0].begin()->second.front().scale, 0.5);
  EXPECT_DOUBLE_EQ(match("plain").unet.at(kLinear).front().scale, 1.0);
}

TEST_F(Lora, is_read_under_the_names_that_comfyui_gives) {
  make::write_lora(path("kohya"), model_,
                   {.naming = LoraNaming::kKohyaLdm, .rank = 4, .text_encoder = false});
  const nn::SafeTensors kohya(path("kohya"));
  std::vector<nn::TensorEntry> renamed;
  for (nn::TensorEntry tensor : kohya.tensors()) {
    const std::string prefix = "lora_unet_";
    ASSERT_TRUE(tensor.name.starts_with(prefix)) << tensor.name;
    tensor.name = "diffusion_model." + tensor.name.substr(prefix.size());
    renamed.push_back(tensor);
  }
  nn::write_safetensors(path("comfy"), renamed);
  const LoraSet expected = match("kohya"), found = match("comfy");
  ASSERT_FALSE(expected.unet.empty());
  ASSERT_EQ(found.unet.size(), expected.unet.size());
  EXPECT_TRUE(
      at::equal(merged(unet_.table, found.unet, kLinear), merged(unet_.table, expected.unet, kLinear)));
}

TEST_F(Lora, words_that_lie_in_it_are_learned_and_do_not_stop_it) {
  make::write_lora(path("plain"), model_, {.rank = 4});
  const nn::SafeTensors plain(path("plain"));
  const std::vector<float> vectors(2 * 128, 0.25f);
  std::vector<nn::TensorEntry> tensors(plain.tensors().begin(), plain.tensors().end());
  tensors.push_back({"bundle_emb.rustword.string_to_param.*",
                     nn::ElementType::kF32,
                     {2, 128},
                     {reinterpret_cast<const uint8_t*>(vectors.data()), vectors.size() * sizeof(float)}});
  nn::write_safetensors(path("bundle"), tensors);
  EXPECT_EQ(match("bundle").unet.size(), match("plain").unet.size());
  const std::vector<LearnedWord> words = read_bundled_words(path("bundle"), 128);
  ASSERT_EQ(words.size(), 1u);
  EXPECT_EQ(words[0].word, "rustword");
  EXPECT_EQ(words[0].count, 2);
  EXPECT_TRUE(read_bundled_words(path("plain"), 128).empty());
  EXPECT_THROW(read_bundled_words(path("bundle"), 768), Error);
}

TEST_F(Lora, of_eight_bits_is_refused_when_it_is_matched) {
  const std::string module = "lora_unet_mid_block_attentions_0_transformer_blocks_0_attn1_to_q";
  const std::vector<uint8_t> bytes(4 * 64);
  std::vector<nn::TensorEntry> tensors;
  tensors.push_back({module + ".lora_down.weight", nn::ElementType::kF8E4M3, {4, 64}, bytes});
  tensors.push_back({module + ".lora_up.weight", nn::ElementType::kF8E4M3, {64, 4}, bytes});
  nn::write_safetensors(path("fp8"), tensors);
  expect_refusal("fp8", "holds F8_E4M3, expected weights of F32, F16 or BF16");
}

TEST_F(Lora, several_add_up) {
  make::write_lora(path("a"), model_, {});
  make::Model other = model_;
  other.seed = 9;
  make::write_lora(path("b"), other, {});
  const std::vector<LoraChoice> both{{path("a"), 1.0f}, {path("b"), -0.5f}};
  const LoraSet set = match_loras(both, unet_, texts());
  EXPECT_EQ(set.unet.at(kLinear).size(), 2u);
  const at::Tensor change = merged(unet_.table, set.unet, kLinear) - plain(unet_.table, kLinear);
  const at::Tensor a = merged(unet_.table, match("a").unet, kLinear) - plain(unet_.table, kLinear);
  const at::Tensor b = merged(unet_.table, match("b", -0.5f).unet, kLinear) - plain(unet_.table, kLinear);
  EXPECT_TRUE(at::allclose(change, a + b, 1e-5, 1e-6));
}

TEST_F(Lora, weight_zero_changes_nothing) {
  make::write_lora(path("lora"), model_, {});
  EXPECT_TRUE(at::equal(merged(unet_.table, match("lora", 0).unet, kLinear), plain(unet_.table, kLinear)));
}

TEST_F(Lora, of_another_family_is_refused_with_both_shapes) {
  make::Model sd2;
  sd2.configs = make::configs_of(Family::kSd2, make::Size::kSmall, 897);
  make::write_lora(path("sd2"), sd2, {});
  expect_refusal("sd2", "make no change of the weight");
  expect_refusal("sd2", "made for another family");
}

TEST_F(Lora, other_adapters_and_strangers_are_named) {
  const auto write = [&](const std::vector<std::string>& names, const std::vector<int64_t>& shape = {2, 2}) {
    std::vector<nn::TensorPlan> plans;
    for (const std::string& name : names) plans.push_back({name, nn::ElementType::kF32, shape});
    nn::write_safetensors(path("x"), plans, nullptr);
  };
  const std::string to_k = "lora_unet_up_blocks_1_attentions_2_transformer_blocks_0_attn2_to_k";
  write({to_k + ".hada_w1_a", to_k + ".hada_w1_b"});
  expect_refusal("x", "a LyCORIS LoHa");
  write({to_k + ".lokr_w1", to_k + ".lokr_w2"});
  expect_refusal("x", "a LyCORIS LoKr");
  write({to_k + ".lora_down.weight", to_k + ".dora_scale"});
  expect_refusal("x", "a DoRA");
  write({to_k + ".lora_down.weight"});
  expect_refusal("x", "has no counterpart");
  write({"lora_unet_nowhere.lora_down.weight", "lora_unet_nowhere.lora_up.weight"});
  expect_refusal("x", "changes 1 modules that this model does not have");
  write({to_k + ".lora_down.weight", to_k + ".something"});
  expect_refusal("x", "is no part of a LoRA that patina knows");
  write({to_k + ".lora_down.weight", to_k + ".lora_up.weight", to_k + ".alpha"}, {4, 4});
  EXPECT_NE(refusal("x"), "accepted");
  expect_refusal("model", "is a checkpoint, expected a LoRA");
}

}  // namespace
}  // namespace patina::diffusion
