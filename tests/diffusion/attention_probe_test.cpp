// The attention row of a query: from the layer's own queries and keys, a distribution, moved by the bias as
// its definition says.
#include "patina/diffusion/attention_probe.h"

#include <cmath>
#include <numeric>
#include <set>

#include "patina/base/error.h"
#include "small_runs.h"

namespace patina::diffusion {
namespace {

using test::made_inputs, test::same_place_bias, test::short_options, test::tiny_model;

/// Queries and keys of the default layer for 2 × 2 views of 128², biased at the same place of other views.
struct Captured {
  EditInputs inputs = made_inputs(2, 128);
  CapturedAttention attention;

  explicit Captured(const EditOptions& options) {
    inputs.bias_levels = same_place_bias(2, 16, 2);
    const auto layers = self_attention_layers(tiny_model(), 256, 256);
    attention = capture_attention(tiny_model(), inputs, options, find_layer(layers, ""), 0, {});
  }
};

EditOptions biased_options() {
  EditOptions options = short_options();
  options.num_steps = 3;
  options.bias_weight = 2;
  return options;
}

/// Softmax weights of one head in float64, plainly.
std::vector<double> head_row(const CapturedAttention& c, size_t query, size_t head,
                             const std::set<int32_t>& biased, double beta) {
  const auto d = static_cast<size_t>(c.layer.head_dim), width = d * static_cast<size_t>(c.layer.num_heads);
  std::vector<double> row(c.k.size() / width);
  for (size_t j = 0; j < row.size(); ++j) {
    double score = 0;
    for (size_t i = 0; i < d; ++i)
      score += static_cast<double>(c.q[query * width + head * d + i]) * c.k[j * width + head * d + i];
    row[j] = std::exp(score / std::sqrt(static_cast<double>(d)) +
                      (biased.count(static_cast<int32_t>(j)) ? beta : 0.0));
  }
  const double sum = std::accumulate(row.begin(), row.end(), 0.0);
  for (double& value : row) value /= sum;
  return row;
}

TEST(AttentionProbe, a_row_is_the_float64_softmax_of_the_layers_own_queries_and_keys) {
  const Captured captured(biased_options());
  const CapturedAttention& c = captured.attention;
  ASSERT_EQ(c.bias_level, 0);
  const attention::KeyBuckets& buckets = captured.inputs.bias_levels[0];
  for (const int64_t query : {int64_t{0}, int64_t{517}, buckets.num_pixels() - 1}) {
    const std::vector<int32_t> keys = attention::biased_keys(buckets, query);
    const std::set<int32_t> biased(keys.begin(), keys.end());
    for (const float beta : {0.0f, c.beta, 3.0f}) {
      const std::vector<float> row = attention_row(c, query, keys, beta);
      ASSERT_EQ(row.size(), static_cast<size_t>(buckets.num_pixels()));
      EXPECT_NEAR(std::accumulate(row.begin(), row.end(), 0.0), 1.0, 1e-5);
      std::vector<double> expected(row.size());
      for (int64_t head = 0; head < c.layer.num_heads; ++head) {
        const auto one = head_row(c, static_cast<size_t>(query), static_cast<size_t>(head), biased, beta);
        for (size_t j = 0; j < one.size(); ++j)
          expected[j] += one[j] / static_cast<double>(c.layer.num_heads);
      }
      for (size_t j = 0; j < row.size(); ++j)
        EXPECT_NEAR(row[j], expected[j], 2e-5 * expected[j] + 1e-9) << j;
    }
  }
}

TEST(AttentionProbe, the_bias_raises_the_share_of_its_keys_by_the_predicted_factor) {
  const Captured captured(biased_options());
  const CapturedAttention& c = captured.attention;
  const int64_t query = 300;
  const std::vector<int32_t> keys = attention::biased_keys(captured.inputs.bias_levels[0], query);
  ASSERT_FALSE(keys.empty());
  EXPECT_EQ(c.beta, 2);
  EditOptions scaled = biased_options();
  scaled.bias_scaling = BiasScaling::kPaper;
  EXPECT_NEAR(Captured(scaled).attention.beta, 2 / std::sqrt(static_cast<double>(c.layer.head_dim)), 1e-6);
  // With p a head's share of the biased keys, the bias makes it e^β p / (1 + (e^β − 1) p).
  double predicted = 0, without = 0;
  const double boost = std::exp(static_cast<double>(c.beta));
  for (int64_t head = 0; head < c.layer.num_heads; ++head) {
    const auto row = head_row(c, static_cast<size_t>(query), static_cast<size_t>(head), {}, 0);
    double p = 0;
    for (const int32_t j : keys) p += row[static_cast<size_t>(j)];
    without += p / static_cast<double>(c.layer.num_heads);
    predicted += boost * p / (1 + (boost - 1) * p) / static_cast<double>(c.layer.num_heads);
  }
  const std::vector<float> row = attention_row(c, query, keys, c.beta);
  double share = 0;
  for (const int32_t j : keys) share += row[static_cast<size_t>(j)];
  EXPECT_NEAR(share, predicted, 1e-5);
  EXPECT_GT(share, 1.2 * without);
}

TEST(AttentionProbe, every_listed_layer_runs_at_the_size_that_is_listed) {
  const EditInputs inputs = made_inputs(1, 64);
  EditOptions options = short_options();
  options.num_steps = 1, options.strength = 1, options.guidance_scale = 1;
  const std::vector<AttentionLayer> layers = self_attention_layers(tiny_model(), 64, 64);
  EXPECT_EQ(layers.size(), 2u * 3 + 1 + 3 * 3);
  for (const AttentionLayer& layer : layers) {
    const CapturedAttention c = capture_attention(tiny_model(), inputs, options, layer, 1, {});
    const auto size = static_cast<size_t>(layer.width * layer.height * layer.num_heads * layer.head_dim);
    EXPECT_EQ(c.q.size(), size) << layer.name;
    EXPECT_EQ(c.k.size(), size) << layer.name;
    EXPECT_NE(c.q, c.k);
  }
}

TEST(AttentionProbe, shows_the_evaluation_that_was_asked_for_of_the_prompts_half) {
  const EditInputs inputs = made_inputs(1, 64);
  const EditOptions options = short_options();
  const AttentionLayer layer = find_layer(self_attention_layers(tiny_model(), 64, 64), "");
  const auto capture = [&](int evaluation, const EditOptions& o) {
    return capture_attention(tiny_model(), inputs, o, layer, evaluation, {});
  };
  const CapturedAttention first = capture(1, options), middle = capture(0, options),
                          last = capture(4, options);
  EXPECT_EQ(first.num_evaluations, 4);
  EXPECT_EQ(middle.evaluation, 2);
  EXPECT_GT(first.timestep, middle.timestep);
  EXPECT_GT(middle.timestep, last.timestep);
  EXPECT_NE(first.q, last.q);
  // The first evaluation of the prompt's half does not depend on the negative prompt; a later one does.
  EditOptions negative = options;
  negative.negative_prompt = "a mossy stone";
  EXPECT_EQ(capture(1, negative).k, first.k);
  EXPECT_NE(capture(4, negative).k, last.k);
  EXPECT_THROW(capture(5, options), Error);
  EXPECT_THROW(capture(-1, options), Error);
}

TEST(AttentionProbe, layers_are_found_by_short_and_whole_name_and_listed_otherwise) {
  const std::vector<AttentionLayer> layers = self_attention_layers(tiny_model(), 256, 256);
  EXPECT_EQ(find_layer(layers, "").name, "up_blocks.3.attentions.2.transformer_blocks.0.attn1");
  EXPECT_EQ(find_layer(layers, "").width, 32);
  EXPECT_EQ(find_layer(layers, "mid_block.attentions.0").width, 4);
  EXPECT_EQ(find_layer(layers, "mid_block.attentions.0.transformer_blocks.0.attn1").width, 4);
  try {
    find_layer(layers, "attentions");
    FAIL() << "found";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUsage);
    for (const char* part :
         {"'attentions'", "32 × 32: down_blocks.0.attentions.0", "4 × 4: mid_block.attentions.0"})
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace patina::diffusion
