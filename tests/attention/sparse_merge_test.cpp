// The CUDA kernel's code on an emulated GPU, against the float64 definition, with the error of a plain
// version in the same 16-bit type as the yardstick; and the lists it reads, against biased_keys.
#include "patina/attention/cuda/sparse_merge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "emulated_gpu/emulated_gpu.h"
#include "merge_problem.h"
#include "patina/base/bf16.h"
#include "patina/base/error.h"

namespace patina::attention::test {
namespace {

using cuda::BiasTiles;
using cuda::Element16;
using cuda::SparseMerge;
using cuda::TiledBlock;

struct Emulated : Merged {
  EmulationReport report;
};
/// sparse_merge of `dense`, rounded to the 16-bit type, on the emulated GPU.
Emulated merge(const Problem& p, const Result& dense, Element16 element, Memory memory = Memory::kTokens,
               const Schedule& schedule = {}) {
  MergeBuffers buffers = lay_out(p, dense, element, memory);
  const int64_t size = buffers.q.size;
  const EmulationReport report = emulate_sparse_merge(buffers.merge, {size, size, size}, schedule);
  return {read_back(p, buffers), report};
}

// ------------------------------------------------------------------------------------------------ lists

TEST(BiasTiles, hold_each_query_s_biased_keys_once) {
  for (const BucketSpec& spec :
       {BucketSpec{2, 9, 7, 2, Landing::kProjected, 0}, BucketSpec{3, 8, 8, 4, Landing::kProjected, 0},
        BucketSpec{1, 13, 5, 1, Landing::kEverywhere, 0}, BucketSpec{2, 3, 17, 0, Landing::kProjected, 0},
        BucketSpec{1, 20, 20, 3, Landing::kProjected, 0}, BucketSpec{2, 6, 6, 30, Landing::kProjected, 0}}) {
    const KeyBuckets buckets = make_buckets(spec, 3);
    const BiasTiles tiles = cuda::make_bias_tiles(buckets);
    EXPECT_EQ(tiles.masks.size(), static_cast<size_t>(tiles.num_tiles()) * cuda::kBlockLanes);
    std::vector<std::vector<int32_t>> found(static_cast<size_t>(buckets.num_pixels()));
    std::vector<bool> tile_used(static_cast<size_t>(tiles.num_tiles()));
    int32_t longest = std::numeric_limits<int32_t>::max();
    for (const TiledBlock& block : tiles.blocks) {
      EXPECT_GT(block.num_tiles, 0);
      EXPECT_LE(block.num_tiles, longest) << "longest first";
      longest = block.num_tiles;
      for (size_t tile = static_cast<size_t>(block.first_tile);
           tile < static_cast<size_t>(block.first_tile + block.num_tiles); ++tile) {
        EXPECT_FALSE(tile_used[tile]);
        tile_used[tile] = true;
        for (size_t key = 0; key < cuda::kTileKeys; ++key)
          ASSERT_LT(static_cast<uint32_t>(tiles.keys[tile * cuda::kTileKeys + key]), buckets.num_pixels());
        for (int lane = 0; lane < cuda::kBlockLanes; ++lane) {
          const uint32_t mask = tiles.masks[tile * cuda::kBlockLanes + static_cast<size_t>(lane)];
          if (lane >= block.num_lanes) {
            ASSERT_EQ(mask, 0u) << "a lane without a query";
            continue;
          }
          const int32_t query = block.query(lane, tiles.row_stride);
          for (size_t key = 0; key < cuda::kTileKeys; ++key)
            if (mask >> key & 1)
              found[static_cast<size_t>(query)].push_back(tiles.keys[tile * cuda::kTileKeys + key]);
        }
      }
    }
    for (int64_t query = 0; query < buckets.num_pixels(); ++query) {
      std::vector<int32_t>& keys = found[static_cast<size_t>(query)];
      std::sort(keys.begin(), keys.end());
      ASSERT_EQ(keys, biased_keys(buckets, query)) << "query " << query;
    }
  }
}

TEST(BiasTiles, are_none_without_biased_keys) {
  EXPECT_TRUE(cuda::make_bias_tiles(make_buckets({2, 9, 7, 2, Landing::kNone, 0}, 3)).blocks.empty());
}

TEST(BiasTiles, let_a_warp_pass_over_tiles_that_hold_nothing_for_it) {
  // Windows of 9 × 9 around two rows of 8 queries see 10 of the 16 rows of cells that the block sees.
  const Problem p =
      make_problem16(merge_spec(1, 1, 16, 1, {3, 16, 16, 4, Landing::kProjected, 1}), Element16::kBf16, 5);
  const BiasTiles tiles = cuda::make_bias_tiles(p.buckets);
  const int64_t per_tile = 4 /*warps*/ * (3 * 4 + 2 * 5) /*of 16 dimensions padded to 40*/;
  const Emulated merged = merge(p, truth(without_bias(p)), Element16::kBf16);
  EXPECT_LT(static_cast<double>(merged.report.multiplications),
            0.85 * static_cast<double>(tiles.num_tiles() * per_tile));
}

// ----------------------------------------------------------------------------------------------- numbers

class SparseMergeCase : public testing::TestWithParam<MergeCase> {};
INSTANTIATE_TEST_SUITE_P(All, SparseMergeCase, testing::ValuesIn(merge_cases()),
                         [](const auto& test_info) { return std::to_string(test_info.index); });

TEST_P(SparseMergeCase, error_is_at_most_twice_that_of_a_plain_version) {
  const auto& [spec, element, memory] = GetParam();
  const Problem p = make_problem16(spec, element, 1);
  const Emulated merged = merge(p, truth(without_bias(p)), element, memory);
  expect_twice_plain(p, merged.result, element);
  EXPECT_EQ(merged.report.conflicts, 0);
}

TEST(SparseMerge, does_not_depend_on_when_copies_arrive_or_which_warp_is_ahead) {
  for (const int64_t dim : {40, 80, 160})  // three, three and two buffers; queries in registers and not
    for (const float beta : {1.8f, 30.0f}) {
      const Problem p = make_problem16(merge_spec(1, 1, dim, 1, {2, 9, 8, 4, Landing::kProjected, beta}),
                                       Element16::kBf16, 2);
      const Result dense = truth(without_bias(p));
      const Emulated expected = merge(p, dense, Element16::kBf16);
      expect_twice_plain(p, expected.result, Element16::kBf16);
      for (const bool late : {false, true})
        for (const bool last_first : {false, true}) {
          const Emulated found = merge(p, dense, Element16::kBf16, Memory::kTokens, {late, last_first});
          EXPECT_EQ(found.bits, expected.bits) << late << last_first;
          EXPECT_EQ(found.result.log_sum_exp, expected.result.log_sum_exp) << late << last_first;
        }
    }
}

TEST(SparseMerge, keeps_every_bit_of_rows_without_biased_keys) {
  for (const float beta : {2.0f, 50.0f, -0.7f}) {
    const Problem p =
        make_problem16(merge_spec(1, 2, 40, 1, {2, 9, 7, 0, Landing::kProjected, beta}), Element16::kBf16, 3);
    const Result dense = truth(without_bias(p));
    const Emulated found = merge(p, dense, Element16::kBf16);
    int kept = 0, changed = 0;
    for (size_t row = 0; row < static_cast<size_t>(p.num_rows()); ++row) {
      bool same =
          static_cast<float>(dense.log_sum_exp[row]) == static_cast<float>(found.result.log_sum_exp[row]);
      for (size_t d = 0; d < 40; ++d)
        same &= bf16_of_float(static_cast<float>(dense.out[row * 40 + d])) == found.bits[row * 40 + d];
      if (biased_keys(p.buckets, static_cast<int64_t>(row) % p.spec.queries).empty()) {
        EXPECT_TRUE(same) << "row " << row;
        ++kept;
      } else {
        changed += !same;
      }
    }
    EXPECT_GT(kept, 10);
    EXPECT_GT(changed, 100);
  }
}

TEST(SparseMerge, gives_nan_in_the_rows_whose_inputs_or_dense_result_hold_it) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Problem p =
      make_problem16(merge_spec(1, 1, 40, 1, {2, 5, 4, 1, Landing::kProjected, 1.8f}), Element16::kBf16, 4);
  const Result dense = truth(without_bias(p));
  const int32_t key = p.buckets.keys[p.buckets.keys.size() / 2];
  p.k[static_cast<size_t>(key) * 40 + 39] = nan;
  const Emulated found = merge(p, dense, Element16::kBf16);
  int affected = 0;
  for (int64_t query = 0; query < p.spec.queries; ++query) {
    const std::vector<int32_t> keys = biased_keys(p.buckets, query);
    const bool reads = std::binary_search(keys.begin(), keys.end(), key);
    affected += reads;
    for (size_t d = 0; d < 40; ++d)
      ASSERT_EQ(std::isnan(found.result.out[static_cast<size_t>(query) * 40 + d]), reads) << query;
  }
  EXPECT_GT(affected, 0);
}

TEST(SparseMerge, takes_scores_of_infinity_as_the_contract_says) {
  const float inf = std::numeric_limits<float>::infinity();
  for (const float beta : {1.8f, 40.0f}) {
    Problem p =
        make_problem16(merge_spec(1, 1, 16, 1, {1, 6, 6, 1, Landing::kProjected, beta}), Element16::kBf16, 5);
    for (size_t i = 0; i < 36; ++i) p.q[i * 16] = 1;
    for (size_t j = 0; j < 30; ++j) p.k[j * 16] = -inf;  // most keys have no weight
    const Emulated found = merge(p, truth(without_bias(p)), Element16::kBf16);
    expect_twice_plain(p, found.result, Element16::kBf16);
  }
}

// ------------------------------------------------------------------------------------------------ limits

TEST(SparseMerge, refuses_what_the_kernel_does_not_take) {
  alignas(16) static uint16_t elements[64];
  static float log_sum_exp[1];
  static const TiledBlock block{0, 0, 1, 1, 1, 512};
  static const int32_t keys[32] = {};
  static const uint32_t masks[64] = {};
  SparseMerge good;
  good.shape = {1, 1, 1, 1, 40};
  good.q = good.k = good.v = good.out = elements;
  good.log_sum_exp = log_sum_exp;
  good.q_strides = good.k_strides = good.v_strides = good.out_strides = {40, 40, 40};
  good.scale = 0.15f;
  good.beta = 1;
  good.blocks = &block, good.keys = keys, good.masks = masks, good.num_blocks = 1, good.row_stride = 1;
  EXPECT_NO_THROW(cuda::validate(good));

  const auto refused = [&](auto change) {
    SparseMerge merge = good;
    change(merge);
    try {
      cuda::validate(merge);
    } catch (const Error& error) {
      return error.code() == ErrorCode::kUsage;
    }
    return false;
  };
  EXPECT_TRUE(refused([](SparseMerge& m) { m.shape.head_dim = 36; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.shape.head_dim = 264; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.shape.head_dim = 0; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.shape.num_keys = 2; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.shape.batch = 70000; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.q = elements + 1; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.k_strides.token = 41; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.v = nullptr; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.out_strides.head = 4; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.log_sum_exp = nullptr; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.scale = 0; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.beta = -1.01f; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.beta = 2e4f; }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.beta = std::numeric_limits<float>::quiet_NaN(); }));
  EXPECT_TRUE(refused([](SparseMerge& m) { m.masks = nullptr; }));
}

TEST(SparseMerge, constants_neither_overflow_nor_cancel) {
  EXPECT_NEAR(cuda::merge_constants(1, 1).log2_weight, std::log2(std::exp(1.0) - 1), 1e-6);
  EXPECT_NEAR(cuda::merge_constants(1, -1).log2_weight, std::log2(1 - std::exp(-1.0)), 1e-6);
  EXPECT_NEAR(cuda::merge_constants(1, 1e-6f).log2_weight, std::log2(1e-6), 1e-5);
  EXPECT_NEAR(cuda::merge_constants(1, 1e4f).log2_weight, 1e4 / std::log(2.0), 1e-2);
  EXPECT_EQ(cuda::merge_constants(1, 1e-6f).dense_sign, 1);
  EXPECT_EQ(cuda::merge_constants(1, -1e-6f).dense_sign, -1);
}

TEST(EmulatedGpu, converts_to_binary16_and_back) {
  for (uint32_t bits = 0; bits < 0x7c00; ++bits)
    ASSERT_EQ(half_of_float(float_of_half(static_cast<uint16_t>(bits))), bits);
  EXPECT_EQ(half_of_float(65519.0f), 0x7bff);
  EXPECT_EQ(half_of_float(65520.0f), 0x7c00);
  EXPECT_EQ(half_of_float(1 + 0x1p-11f), 0x3c00);      // half way: to even
  EXPECT_EQ(half_of_float(1 + 3 * 0x1p-11f), 0x3c02);  // half way: to even
  EXPECT_EQ(half_of_float(-0x1p-24f), 0x8001);
  EXPECT_EQ(half_of_float(0x1p-26f), 0);
}

}  // namespace
}  // namespace patina::attention::test
