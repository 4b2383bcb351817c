// attend() on a CUDA device against float64 on the CPU. Built by the cuda preset; what needs a device is
// skipped where there is none.
#include "patina/nn/attend_cuda.h"

#include <cmath>
#include <cstring>

#include <ATen/ATen.h>
#include <ATen/CPUGeneratorImpl.h>

#include <gtest/gtest.h>

#include "patina/attention/cuda/bias_tiles.h"
#include "patina/base/error.h"

namespace patina::nn {
namespace {

#define PATINA_REQUIRE_DEVICE() \
  if (!at::hasCUDA()) GTEST_SKIP() << "no CUDA device here"

const at::Device kDevice(at::kCUDA, 0);

at::Tensor random(at::IntArrayRef shape, uint64_t seed) {
  at::Generator generator = at::detail::createCPUGenerator(seed);
  return at::randn(shape, generator, at::kFloat);
}

/// Four views of `view` × `view` pixels; key j lands at the pixel of its own place in the next view.
attention::KeyBuckets next_view_buckets(int view) {
  attention::KeyBuckets buckets;
  buckets.grid = 2;
  buckets.view_width = buckets.view_height = view;
  buckets.window_radius = 1;
  std::vector<int32_t> key_of_cell(static_cast<size_t>(buckets.num_pixels()));
  for (int32_t key = 0; key < buckets.num_pixels(); ++key) {
    const int x = key % (2 * view), y = key / (2 * view);
    const int next = (y / view * 2 + x / view + 1) % 4;
    const int cell = (next / 2 * view + y % view) * 2 * view + next % 2 * view + x % view;
    key_of_cell[static_cast<size_t>(cell)] = key;
  }
  buckets.keys = key_of_cell;
  for (int32_t cell = 0; cell <= buckets.num_pixels(); ++cell) buckets.offsets.push_back(cell);
  return buckets;
}

/// softmax(q kᵀ/√d + β[j ∈ S_i]) v in float64.
at::Tensor plain_attention(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t heads,
                           const attention::KeyBuckets* buckets, double beta) {
  const auto split = [&](const at::Tensor& x) {
    return x.to(at::kCPU, at::kDouble).view({x.size(0), x.size(1), heads, -1}).transpose(1, 2);
  };
  at::Tensor scores =
      at::matmul(split(q), split(k).transpose(2, 3)) / std::sqrt(static_cast<double>(q.size(2) / heads));
  if (buckets) {
    const at::Tensor mask = at::zeros({q.size(1), k.size(1)}, at::kDouble);
    for (int64_t i = 0; i < q.size(1); ++i)
      for (const int32_t j : attention::biased_keys(*buckets, i)) mask[i][j] = beta;
    scores = scores + mask;
  }
  return at::matmul(at::softmax(scores, -1), split(v)).transpose(1, 2).reshape(q.sizes());
}

double relative_error(const at::Tensor& found, const at::Tensor& exact) {
  return ((found.to(at::kCPU, at::kDouble) - exact).norm() / exact.norm()).item<double>();
}

TEST(AttendCuda, equals_plain_attention_with_and_without_bias) {
  PATINA_REQUIRE_DEVICE();
  const attention::KeyBuckets buckets = next_view_buckets(12);
  for (const at::ScalarType dtype : {at::kBFloat16, at::kHalf})
    for (const int64_t head_dim : {8, 40, 64, 80, 128, 160, 256}) {
      const auto make = [&](uint64_t seed) {
        return random({2, buckets.num_pixels(), 2 * head_dim}, seed).to(kDevice, dtype);
      };
      const at::Tensor q = make(1), k = make(2), v = make(3);
      const double allowed = dtype == at::kHalf ? 8e-4 : 6e-3;
      EXPECT_LT(relative_error(attend(q, k, v, 2), plain_attention(q, k, v, 2, nullptr, 0)), allowed);
      EXPECT_LT(relative_error(attend(q, k, v, 2, {&buckets, 1.7f}),
                               plain_attention(q, k, v, 2, &buckets, static_cast<double>(1.7f))),
                allowed)
          << "head_dim " << head_dim;
    }
}

TEST(AttendCuda, takes_text_tokens_f32_and_wide_heads_without_bias) {
  PATINA_REQUIRE_DEVICE();
  const at::Tensor q = random({2, 200, 80}, 1), k = random({2, 77, 80}, 2), v = random({2, 77, 80}, 3);
  EXPECT_LT(relative_error(attend(q.to(kDevice), k.to(kDevice), v.to(kDevice), 2),
                           plain_attention(q, k, v, 2, nullptr, 0)),
            1e-3);
  const at::Tensor wide = random({1, 150, 512}, 4);  // the VAE's
  EXPECT_LT(relative_error(attend(wide.to(kDevice), wide.to(kDevice), wide.to(kDevice), 1),
                           plain_attention(wide, wide, wide, 1, nullptr, 0)),
            1e-3);
}

TEST(AttendCuda, is_bit_equal_without_bias_where_beta_is_zero) {
  PATINA_REQUIRE_DEVICE();
  const attention::KeyBuckets buckets = next_view_buckets(8);
  const at::Tensor x = random({1, 256, 80}, 5).to(kDevice, at::kBFloat16);
  EXPECT_TRUE(at::equal(attend(x, x, x, 2, {&buckets, 0}), attend(x, x, x, 2)));
}

TEST(AttendCuda, takes_slices_and_rows_that_do_not_lie_on_16_bytes) {
  PATINA_REQUIRE_DEVICE();
  const attention::KeyBuckets buckets = next_view_buckets(8);
  const at::Tensor wide = random({2, 256, 3 * 80 + 4}, 6).to(kDevice, at::kBFloat16);
  for (const int64_t first : {0, 4}) {
    const std::vector<at::Tensor> parts = wide.narrow(2, first, 240).chunk(3, -1);
    EXPECT_LT(relative_error(attend(parts[0], parts[1], parts[2], 2, {&buckets, 2.0f}),
                             plain_attention(parts[0].contiguous(), parts[1].contiguous(),
                                             parts[2].contiguous(), 2, &buckets, 2.0)),
              6e-3);
  }
}

TEST(AttendCuda, refuses_what_only_the_cpu_does) {
  PATINA_REQUIRE_DEVICE();
  const attention::KeyBuckets buckets = next_view_buckets(8);
  const auto refused = [&](const at::Tensor& x, const LevelBias& bias) {
    try {
      attend(x, x, x, 1, bias);
    } catch (const Error& error) {
      return error.code() == ErrorCode::kUsage;
    }
    return false;
  };
  const at::Tensor x = random({1, 256, 40}, 7).to(kDevice);
  EXPECT_TRUE(refused(x, {&buckets, 1})) << "f32";
  EXPECT_TRUE(refused(x.to(at::kHalf), {&buckets, -2})) << "a strongly negative bias";
  EXPECT_TRUE(refused(x.to(at::kHalf).narrow(1, 0, 200), {&buckets, 1})) << "another number of tokens";
  EXPECT_TRUE(refused(x.to(at::kHalf).narrow(2, 0, 36), {})) << "a head dimension that no kernel takes";
}

TEST(DeviceTiles, are_uploaded_once_a_level_and_device) {
  PATINA_REQUIRE_DEVICE();
  const std::vector<attention::KeyBuckets> levels{next_view_buckets(8), next_view_buckets(4)};
  const SelfAttentionBias bias{levels, 2.0f};
  const SelfAttentionBias copy = bias;
  const DeviceTiles& fine = bias.tiles->of(levels[0], kDevice);
  EXPECT_EQ(&copy.tiles->of(levels[0], kDevice), &fine);
  EXPECT_NE(&bias.tiles->of(levels[1], kDevice), &fine);
  EXPECT_EQ(bias.at(16, 16, 40).tiles, bias.tiles.get());
}

// The upload itself needs no GPU: tensors on the CPU hold the same bytes.
TEST(DeviceTiles, hold_the_tiles_bytes) {
  const attention::KeyBuckets buckets = next_view_buckets(9);
  const attention::cuda::BiasTiles tiles = attention::cuda::make_bias_tiles(buckets);
  const DeviceTiles uploaded = upload_tiles(buckets, at::kCPU);
  EXPECT_EQ(uploaded.num_blocks, static_cast<int32_t>(tiles.blocks.size()));
  EXPECT_EQ(uploaded.row_stride, 18);
  const auto same = [](const at::Tensor& tensor, const auto& values) {
    return tensor.nbytes() == values.size() * sizeof(values[0]) &&
           std::memcmp(tensor.data_ptr(), values.data(), tensor.nbytes()) == 0;
  };
  EXPECT_TRUE(same(uploaded.blocks, tiles.blocks));
  EXPECT_TRUE(same(uploaded.keys, tiles.keys));
  EXPECT_TRUE(same(uploaded.masks, tiles.masks));
}

}  // namespace
}  // namespace patina::nn
