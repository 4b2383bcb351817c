// Prompts through the text encoder: weights, long text, learned words, the end of CLIP's layers; and what a
// U-Net predicts, asked of it.
#include "patina/diffusion/text/text_conditioning.h"

#include <array>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "make_checkpoint/configs.h"
#include "patina/base/error.h"
#include "patina/diffusion/prediction.h"
#include "support.h"

namespace patina::diffusion {
namespace {

class Conditioning : public testing::Test {
 protected:
  at::Tensor encode(const std::vector<std::string>& prompts, const LearnedWords& words = {},
                    int64_t skip = 1) {
    return encode_prompts(tokenizer(), encoder(), words, prompts, skip).tokens;
  }
  static const Tokenizer& tokenizer() {
    static const Tokenizer tokenizer(test::data_dir() / "tiny-sd" / "tokenizer");
    return tokenizer;
  }
  static const TextEncoder& encoder() {
    static const TextEncoder encoder(test::data_dir() / "tiny-sd" / "text_encoder", at::kFloat);
    return encoder;
  }
  c10::InferenceMode inference_;
};

TEST_F(Conditioning, a_plain_prompt_is_the_text_encoders_own_output_to_the_bit) {
  for (const char* prompt : {"", "a rusty old kettle", "\\(old\\)"}) {
    const std::string text = std::string(prompt) == "\\(old\\)" ? "(old)" : prompt;
    const at::Tensor ids = at::tensor(tokenizer().encode_padded(text, 77), at::kLong).unsqueeze(0);
    EXPECT_TRUE(at::equal(encode({prompt}), encoder()(ids).tokens));
    EXPECT_TRUE(at::equal(encode({prompt}, {}, 2), encoder()(ids, 2).tokens));
  }
}

TEST_F(Conditioning, weights_scale_their_tokens_and_keep_the_mean) {
  const at::Tensor plain = encode({"rusty kettle"}), weighted = encode({"(rusty:1.4) kettle"});
  EXPECT_NEAR(weighted.mean().item<double>(), plain.mean().item<double>(), 1e-6);
  // All tokens but the weighted ones change by one common factor.
  const auto num_rusty = static_cast<int64_t>(tokenizer().tokens("rusty").size());
  const at::Tensor ratio = weighted / plain;
  const double common = ratio[0][0][0].item<double>();
  EXPECT_NE(common, 1.0);
  EXPECT_NEAR(ratio[0][70][3].item<double>(), common, 1e-5);
  for (int64_t t = 1; t <= num_rusty; ++t) EXPECT_NEAR(ratio[0][t][5].item<double>(), 1.4 * common, 1e-4);
}

TEST_F(Conditioning, both_prompts_get_as_many_chunks_as_the_longer_needs) {
  std::string text;
  for (int i = 0; i < 100; ++i) text += "! ";
  const at::Tensor both = encode({"clean", text});
  ASSERT_EQ(both.sizes(), at::IntArrayRef({2, 154, 64}));
  EXPECT_TRUE(at::equal(both.slice(0, 0, 1).slice(1, 0, 77), encode({"clean"})));
  EXPECT_TRUE(at::equal(both.slice(0, 0, 1).slice(1, 77, 154), encode({""})));
  EXPECT_FALSE(at::equal(both.slice(0, 1, 2).slice(1, 0, 77), both.slice(0, 1, 2).slice(1, 77, 154)));
}

TEST_F(Conditioning, pooled_is_the_text_encoders_own_of_the_first_chunk) {
  const std::vector<std::string> prompts{"a rusty old kettle", "(clean:1.3)"};
  const TextConditioning both = encode_prompts(tokenizer(), encoder(), {}, prompts);
  ASSERT_EQ(both.pooled.sizes(), at::IntArrayRef({2, 64}));
  const std::vector<std::string> plain{"a rusty old kettle", "clean"};
  for (int64_t i = 0; i < 2; ++i) {
    const std::vector<int64_t> ids = tokenizer().encode_padded(plain[static_cast<size_t>(i)], 77);
    EXPECT_TRUE(at::equal(both.pooled[i], encoder()(at::tensor(ids, at::kLong).unsqueeze(0)).pooled[0]));
  }
}

TEST_F(Conditioning, prompts_are_stacked_and_split_and_encoders_joined_without_loss) {
  const std::vector<std::string> first{"clean"}, second{"rusty"}, both{"clean", "rusty"};
  const TextConditioning a = encode_prompts(tokenizer(), encoder(), {}, first),
                         b = encode_prompts(tokenizer(), encoder(), {}, second);
  const TextConditioning stacked = stack_prompts(std::array{a, b});
  EXPECT_TRUE(at::equal(stacked.tokens, encode_prompts(tokenizer(), encoder(), {}, both).tokens));
  const std::vector<TextConditioning> split = split_prompts(stacked, 1);
  ASSERT_EQ(split.size(), 2u);
  EXPECT_TRUE(at::equal(split[1].tokens, b.tokens));
  EXPECT_TRUE(at::equal(split[1].pooled, b.pooled));
  const TextConditioning joined = join_encoders(std::array{a, b});
  EXPECT_EQ(joined.tokens.size(2), 2 * a.tokens.size(2));
  EXPECT_TRUE(at::equal(joined.tokens.slice(2, a.tokens.size(2)), b.tokens));
  EXPECT_TRUE(at::equal(joined.pooled, b.pooled));
}

TEST_F(Conditioning, a_learned_copy_of_a_token_is_that_token) {
  // Vectors of the words "moss" and "!" under a new name.
  const nn::SafeTensors weights(test::data_dir() / "tiny-sd" / "text_encoder" / "model.safetensors");
  const at::Tensor table =
      nn::read_tensor(weights, *weights.find("text_model.embeddings.token_embedding.weight"), at::kFloat);
  const at::Tensor ids = at::tensor(tokenizer().tokens("moss !"), at::kLong);
  const LearnedWords words{{{"newword", encoder().config().vocab_size, ids.size(0)}},
                           table.index_select(0, ids)};
  EXPECT_TRUE(at::equal(encode({"old newword kettle"}, words), encode({"old moss ! kettle"})));
}

TEST_F(Conditioning, clip_skip_past_the_layers_is_refused) {
  EXPECT_THROW(encode({"x"}, {}, 4), Error);
  EXPECT_THROW(encode({"x"}, {}, 0), Error);
}

/// Zeros but for what is given.
class FewWeights final : public nn::WeightSource {
 public:
  std::map<std::string, at::Tensor> given;
  std::string where() const override { return "test"; }
  bool has(const std::string& name) const override { return given.contains(name); }
  at::Tensor find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) override {
    const auto found = given.find(name);
    return found == given.end() ? at::zeros(expected, type) : found->second.to(type);
  }
  std::vector<std::string> names() const override { return {}; }
};

TEST_F(Conditioning, a_network_that_gives_back_the_noise_predicts_it_and_another_v) {
  const UNetConfig config = make_checkpoint::configs_of(Family::kSd1, make_checkpoint::Size::kSmall).unet;
  const int64_t channels = config.levels.front().channels, in = config.in_channels;
  // conv_in hands the four latent channels on; the last resnet's shortcut takes them from the skip
  // connection, and conv_out takes them back.
  const auto pass = [](int64_t out, int64_t from, int64_t kernel, int64_t count, int64_t offset) {
    at::Tensor weight = at::zeros({out, from, kernel, kernel});
    for (int64_t c = 0; c < count; ++c) weight[c][offset + c][kernel / 2][kernel / 2] = 1;
    return weight;
  };
  FewWeights source;
  source.given["conv_in.weight"] = pass(channels, in, 3, in, 0);
  source.given["up_blocks.3.resnets.2.conv_shortcut.weight"] = pass(channels, 2 * channels, 1, in, channels);
  source.given["conv_norm_out.weight"] = at::ones({channels});
  source.given["conv_out.weight"] = pass(in, channels, 3, in, 0);
  nn::WeightReader reader(source, at::kFloat);
  EXPECT_EQ(ask_prediction(UNet(config, reader), {}), Prediction::kEpsilon);

  source.given.erase("conv_out.weight");
  nn::WeightReader blank(source, at::kFloat);
  EXPECT_EQ(ask_prediction(UNet(config, blank), {}), Prediction::kV);
}

}  // namespace
}  // namespace patina::diffusion
