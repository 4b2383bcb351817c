// Attention over the keys of other pictures too, against the definition in float64.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/nn/attend.h"

namespace patina::nn {
namespace {

struct Case {
  int64_t batch, heads, head_dim, num_extra_keys, num_extras;
  bool is_biased;
  at::ScalarType type;
};

// 2 × 2 views of 4 × 3 latent pixels; every pixel favours its own place in the other views.
attention::KeyBuckets buckets() {
  attention::KeyBuckets made;
  made.grid = 2, made.view_width = 4, made.view_height = 3, made.window_radius = 1;
  made.offsets.push_back(0);
  for (int y = 0; y < made.height(); ++y)
    for (int x = 0; x < made.width(); ++x) {
      for (int vy = 0; vy < 2; ++vy)
        for (int vx = 0; vx < 2; ++vx)
          if (vx != x / 4 || vy != y / 3)
            made.keys.push_back((vy * 3 + y % 3) * made.width() + vx * 4 + x % 4);
      made.offsets.push_back(static_cast<int32_t>(made.keys.size()));
    }
  return made;
}

at::Tensor by_head(const at::Tensor& x, int64_t heads) {
  return x.to(at::kDouble).unflatten(2, {heads, -1}).transpose(1, 2);
}

// softmax over all keys at once.
at::Tensor defined(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t heads,
                   const LevelBias& bias, std::span<const ExtraKeys> extra) {
  const at::Tensor hq = by_head(q, heads);
  const double scale = 1 / std::sqrt(static_cast<double>(hq.size(3)));
  at::Tensor own = at::matmul(hq, by_head(k, heads).transpose(2, 3)) * scale;
  if (bias.buckets)
    for (int64_t i = 0; i < q.size(1); ++i)
      for (const int32_t j : attention::biased_keys(*bias.buckets, i))
        own.select(2, i).select(2, j) += static_cast<double>(bias.beta);
  std::vector<at::Tensor> scores{own}, values{by_head(v, heads)};
  for (const ExtraKeys& keys : extra) {
    scores.push_back(at::matmul(hq, by_head(keys.k, heads).transpose(2, 3)) * scale +
                     keys.log_weight.to(at::kDouble).unsqueeze(3));
    values.push_back(by_head(keys.v, heads));
  }
  return at::matmul(at::softmax(at::cat(scores, 3), 3), at::cat(values, 2)).transpose(1, 2).flatten(2);
}

void check(const Case& c) {
  const attention::KeyBuckets favoured = buckets();
  const int64_t num_queries = favoured.num_pixels(), width = c.heads * c.head_dim;
  const auto random = [&](int64_t tokens) { return at::randn({c.batch, tokens, width}).to(c.type); };
  const at::Tensor q = random(num_queries), k = random(num_queries), v = random(num_queries);
  const LevelBias bias = c.is_biased ? LevelBias{&favoured, 1.5f} : LevelBias{};
  std::vector<ExtraKeys> extra;
  for (int64_t e = 0; e < c.num_extras; ++e) {
    // Some queries do not look, one looks hard; each batch in its own way.
    at::Tensor log_weight = at::randn({c.batch, 1, num_queries});
    log_weight.slice(2, 0, 5).fill_(-std::numeric_limits<float>::infinity());
    log_weight.select(2, 7).fill_(std::log(100.0f));
    extra.push_back({random(c.num_extra_keys + e), random(c.num_extra_keys + e), log_weight});
  }
  const at::Tensor out = attend(q, k, v, c.heads, bias, extra);
  ASSERT_EQ(out.sizes(), q.sizes());
  ASSERT_EQ(out.scalar_type(), c.type);
  const double tolerance = c.type == at::kFloat ? 5e-6 : 3e-2;
  EXPECT_LT((out.to(at::kDouble) - defined(q, k, v, c.heads, bias, extra)).abs().max().item<double>(),
            tolerance);
}

TEST(ExtraKeys, are_part_of_the_softmax) {
  const c10::InferenceMode inference;
  at::manual_seed(11);
  int num_cases = 0;
  for (const int64_t batch : {1, 2})
    for (const int64_t heads : {1, 3})
      for (const int64_t head_dim : {8, 32, 40})
        for (const int64_t num_extra_keys : {1, 12, 200})
          for (const int64_t num_extras : {1, 2})
            for (const bool is_biased : {false, true})
              for (const at::ScalarType type : {at::kFloat, at::kBFloat16}) {
                SCOPED_TRACE(testing::Message() << batch << " " << heads << " " << head_dim << " "
                                                << num_extra_keys << " " << num_extras << " " << is_biased);
                check({batch, heads, head_dim, num_extra_keys, num_extras, is_biased, type});
                ++num_cases;
              }
  EXPECT_EQ(num_cases, 288);
}

TEST(ExtraKeys, that_nobody_looks_at_change_nothing) {
  const c10::InferenceMode inference;
  const at::Tensor q = at::randn({1, 30, 16}), k = at::randn({1, 30, 16}), v = at::randn({1, 30, 16});
  const std::vector<ExtraKeys> extra{{at::randn({1, 9, 16}), at::randn({1, 9, 16}),
                                      at::full({1, 1, 1}, -std::numeric_limits<float>::infinity())}};
  EXPECT_TRUE(at::equal(attend(q, k, v, 2, {}, extra), attend(q, k, v, 2)));
}

}  // namespace
}  // namespace patina::nn
