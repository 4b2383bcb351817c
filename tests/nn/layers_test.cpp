// Layers against plain arithmetic in float64, and what bf16 may cost.
#include "patina/nn/layers.h"

#include <cmath>

#include <ATen/ATen.h>
#include <ATen/CPUGeneratorImpl.h>
#include <c10/core/InferenceMode.h>

#include <gtest/gtest.h>

#include "patina/base/parallel.h"
#include "patina/nn/attend.h"

namespace patina::nn {
namespace {

double max_difference(const at::Tensor& a, const at::Tensor& b) {
  return (a.to(at::kDouble) - b.to(at::kDouble)).abs().max().item<double>();
}

at::Tensor random(at::IntArrayRef shape, uint64_t seed) {
  at::Generator generator = at::detail::createCPUGenerator(seed);
  return at::randn(shape, generator, at::kFloat);
}

GroupNorm group_norm(int64_t channels, int64_t num_groups) {
  return {"norm", random({channels}, 1), random({channels}, 2), num_groups, 1e-5};
}

/// By its definition, in float64.
at::Tensor plain_group_norm(const GroupNorm& layer, const at::Tensor& x) {
  const at::Tensor groups = x.to(at::kDouble).reshape({x.size(0), layer.num_groups, -1});
  const at::Tensor mean = groups.mean(-1, true), centred = groups - mean;
  const at::Tensor normal = centred / (centred.square().mean(-1, true) + layer.epsilon).sqrt();
  const auto per_channel = [](const at::Tensor& w) { return w.to(at::kDouble).view({1, -1, 1, 1}); };
  return normal.view(x.sizes()) * per_channel(layer.weight) + per_channel(layer.bias);
}

TEST(GroupNorm, equals_its_definition_in_either_memory_format) {
  const GroupNorm layer = group_norm(12, 4);
  const at::Tensor x = random({2, 12, 7, 5}, 3) * 3 + 40;  // a mean far from 0: sums of squares would cancel
  const at::Tensor expected = plain_group_norm(layer, x);
  EXPECT_LT(max_difference(layer(x, {}), expected), 1e-4);
  EXPECT_LT(max_difference(layer(x.contiguous(at::MemoryFormat::ChannelsLast), {}), expected), 1e-4);
}

TEST(GroupNorm, costs_bf16_nothing_but_the_rounding_of_input_and_output) {
  const GroupNorm layer = group_norm(8, 2);
  const at::Tensor x = random({1, 8, 64, 64}, 4).to(at::kBFloat16);
  const at::Tensor expected = plain_group_norm(layer, x.to(at::kFloat));
  EXPECT_LE(max_difference(layer(x, {}), expected), expected.abs().max().item<double>() / 256);
}

/// Largest error that rounding the result to the type of x explains, and little more.
double tolerance(const at::Tensor& x, const at::Tensor& expected) {
  return expected.abs().max().item<double>() * (x.scalar_type() == at::kBFloat16 ? 1.0 / 256 : 3e-6) + 1e-6;
}

// Without gradients our own kernels work; the cases above also ran LibTorch's.
TEST(Kernels, group_norm_equals_its_definition_with_and_without_silu) {
  const c10::InferenceMode inference;
  struct Case {
    int64_t batch, channels, groups, height, width;
  };
  for (const Case& c : {Case{1, 8, 2, 1, 1}, {2, 12, 4, 7, 5}, {1, 320, 32, 33, 17}, {3, 6, 6, 64, 3}}) {
    const GroupNorm layer = group_norm(c.channels, c.groups);
    for (const at::ScalarType type : {at::kFloat, at::kBFloat16}) {
      const at::Tensor x = (random({c.batch, c.channels, c.height, c.width}, 3) * 3 + 5).to(type);
      const at::Tensor expected = plain_group_norm(layer, x.to(at::kFloat));
      for (const at::Tensor& image : {x, x.contiguous(at::MemoryFormat::ChannelsLast)}) {
        const at::Tensor y = layer(image, {}), activated = layer.with_silu(image, {});
        EXPECT_EQ(y.scalar_type(), type);
        EXPECT_TRUE(y.is_contiguous(at::MemoryFormat::ChannelsLast));
        EXPECT_LE(max_difference(y, expected), tolerance(x, expected) + (type == at::kFloat ? 2e-5 : 0));
        EXPECT_LE(max_difference(activated, expected * at::sigmoid(expected)),
                  tolerance(x, expected) + (type == at::kFloat ? 2e-5 : 0));
      }
    }
  }
}

TEST(Kernels, group_norm_keeps_its_digits_beside_a_large_mean) {
  const c10::InferenceMode inference;
  const GroupNorm layer = group_norm(16, 2);
  const at::Tensor x = random({1, 16, 96, 96}, 6) * 0.01 + 100;
  // 0.01 beside 100 has about three digits in f32.
  EXPECT_LE(max_difference(layer(x, {}), plain_group_norm(layer, x)), 5e-3);
}

TEST(Kernels, layer_norm_equals_its_definition) {
  const c10::InferenceMode inference;
  for (const int64_t channels : {1, 13, 16, 320, 1283}) {
    const LayerNorm layer{"norm", random({channels}, 1), random({channels}, 2), 1e-5};
    for (const at::ScalarType type : {at::kFloat, at::kBFloat16}) {
      const at::Tensor x = (random({2, 9, channels}, 3) * 2 + 7).to(type), wide = x.to(at::kDouble);
      const at::Tensor centred = wide - wide.mean(-1, true);
      const at::Tensor expected =
          centred / (centred.square().mean(-1, true) + 1e-5).sqrt() * layer.weight.to(at::kDouble) +
          layer.bias.to(at::kDouble);
      EXPECT_LE(max_difference(layer(x, {}), expected), tolerance(x, expected) + 1e-5) << channels;
    }
  }
}

TEST(Kernels, geglu_equals_its_definition_over_the_whole_range) {
  const c10::InferenceMode inference;
  const at::Tensor gate = at::linspace(-12, 12, 4801), value = at::ones_like(gate);
  const at::Tensor wide = gate.to(at::kDouble);
  const at::Tensor expected = 0.5 * wide * (1 + at::erf(wide / std::sqrt(2.0)));
  EXPECT_LE(max_difference(geglu(at::cat({value, gate})), expected), 1e-6);
  for (const at::ScalarType type : {at::kFloat, at::kBFloat16}) {
    const at::Tensor x = (random({3, 5, 2 * 77}, 8) * 3).to(type), halves = x.to(at::kDouble);
    const at::Tensor b = halves.slice(2, 77);
    const at::Tensor product = halves.slice(2, 0, 77) * (0.5 * b * (1 + at::erf(b / std::sqrt(2.0))));
    EXPECT_LE(max_difference(geglu(x), product), tolerance(x, product));
  }
}

TEST(Kernels, show_numbers_that_are_none) {
  const c10::InferenceMode inference;
  for (const at::ScalarType type : {at::kFloat, at::kBFloat16}) {
    const at::Tensor x = at::full({1, 4, 2, 2}, std::nan(""), at::dtype(type));
    EXPECT_TRUE(at::isnan(group_norm(4, 2).with_silu(x, {})).all().item<bool>());
    EXPECT_TRUE(at::isnan(geglu(x)).all().item<bool>());
  }
}

TEST(Kernels, give_the_same_bits_on_any_number_of_threads) {
  const c10::InferenceMode inference;
  const at::Tensor x = random({1, 64, 128, 130}, 9).to(at::kBFloat16);
  const GroupNorm layer = group_norm(64, 8);
  set_num_threads(1);
  const at::Tensor alone = layer.with_silu(x, {});
  set_num_threads(0);
  EXPECT_TRUE(layer.with_silu(x, {}).equal(alone));
}

TEST(Recorder, hears_every_layer_under_its_name) {
  std::vector<std::string> heard;
  const Recorder record([&](const std::string& name, const at::Tensor&) { heard.push_back(name); });
  group_norm(4, 2)(random({1, 4, 2, 2}, 5), record);
  EXPECT_EQ(heard, std::vector<std::string>{"norm"});
}

struct Case {
  int64_t batch, queries, keys, heads, head_dim;
};

/// softmax(q kᵀ/√d + β·mask) v in float64, mask [N,M] or undefined.
at::Tensor plain_attention(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t heads,
                           const at::Tensor& mask, double beta) {
  const auto split = [&](const at::Tensor& x) {
    return x.to(at::kDouble).view({x.size(0), x.size(1), heads, -1}).transpose(1, 2);
  };
  at::Tensor scores =
      at::matmul(split(q), split(k).transpose(2, 3)) / std::sqrt(static_cast<double>(q.size(2) / heads));
  if (mask.defined()) scores = scores + beta * mask;
  return at::matmul(at::softmax(scores, -1), split(v)).transpose(1, 2).reshape(q.sizes());
}

TEST(Attend, equals_plain_attention) {
  for (const Case& c :
       {Case{1, 1, 1, 1, 4}, Case{2, 35, 77, 3, 16}, Case{1, 130, 130, 2, 40}, Case{2, 64, 64, 1, 48}}) {
    const at::Tensor q = random({c.batch, c.queries, c.heads * c.head_dim}, 6),
                     k = random({c.batch, c.keys, c.heads * c.head_dim}, 7);
    const at::Tensor v = random({c.batch, c.keys, c.heads * c.head_dim}, 8);
    const at::Tensor expected = plain_attention(q, k, v, c.heads, {}, 0);
    EXPECT_LT(max_difference(attend(q, k, v, c.heads), expected), 2e-6) << c.queries << " × " << c.keys;
    // bf16: the rounding of the inputs, which the float64 result on the rounded inputs shares, and of the
    // output.
    const at::Tensor qb = q.to(at::kBFloat16), kb = k.to(at::kBFloat16), vb = v.to(at::kBFloat16);
    const at::Tensor expected_bf16 = plain_attention(qb, kb, vb, c.heads, {}, 0);
    EXPECT_LT(max_difference(attend(qb, kb, vb, c.heads), expected_bf16), 0.02)
        << c.queries << " × " << c.keys;
  }
}

TEST(Attend, takes_slices_of_larger_tensors) {
  const at::Tensor qkv = random({2, 20, 3 * 32}, 9);
  const std::vector<at::Tensor> parts = qkv.chunk(3, -1);
  const at::Tensor expected = attend(parts[0].contiguous(), parts[1].contiguous(), parts[2].contiguous(), 2);
  EXPECT_LT(max_difference(attend(parts[0], parts[1], parts[2], 2), expected), 1e-6);
}

TEST(Attend, adds_beta_to_the_pairs_of_the_buckets) {
  // Two views side by side of 2 × 1 pixels; key 2 lands on pixel 0 of the first view, and windows hold one
  // cell.
  attention::KeyBuckets buckets;
  buckets.grid = 2, buckets.view_width = 2, buckets.view_height = 1;
  buckets.offsets = {0, 1, 1, 1, 1, 1, 1, 1, 1};
  buckets.keys = {2};
  const at::Tensor q = random({2, 8, 12}, 10), k = random({2, 8, 12}, 11), v = random({2, 8, 12}, 12);
  at::Tensor mask = at::zeros({8, 8}, at::kDouble);
  mask[0][2] = 1;
  EXPECT_LT(max_difference(attend(q, k, v, 3, {&buckets, 1.7f}), plain_attention(q, k, v, 3, mask, 1.7f)),
            2e-6);
}

TEST(SelfAttentionBias, finds_its_level_by_size_and_scales_as_asked) {
  attention::KeyBuckets fine, coarse;
  fine.grid = coarse.grid = 2;
  fine.view_width = fine.view_height = 4, coarse.view_width = coarse.view_height = 2;
  const std::vector<attention::KeyBuckets> levels{fine, coarse};
  SelfAttentionBias bias{levels, 3.0f, true};
  EXPECT_EQ(bias.level(8, 8), &levels[0]);
  EXPECT_EQ(bias.level(4, 4), &levels[1]);
  EXPECT_EQ(bias.level(2, 2), nullptr);
  EXPECT_FLOAT_EQ(bias.beta(36), 0.5f);
  EXPECT_EQ(bias.at(4, 4, 36).buckets, &levels[1]);
  EXPECT_FLOAT_EQ(bias.at(4, 4, 36).beta, 0.5f);
  EXPECT_EQ(bias.at(2, 2, 36).buckets, nullptr);
  bias.scaled_with_scores = false;
  EXPECT_FLOAT_EQ(bias.beta(36), 3.0f);
  bias.weight = 0;
  EXPECT_EQ(bias.level(8, 8), nullptr);
}

}  // namespace
}  // namespace patina::nn
