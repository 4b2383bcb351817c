// The CUDA kernel's code on an emulated GPU, against the float64 definition, with the error of a plain
// version in the same 16-bit type as the yardstick; and the lists it reads, against biased_keys.
#include "patina/attention/cuda/sparse_merge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <gtest/gtest.h>

#include "emulated_gpu.h"
#include "patina/attention/bf16.h"
#include "patina/base/error.h"
#include "problem.h"

namespace patina::attention::test {
namespace {

using cuda::BiasTiles;
using cuda::Element16;
using cuda::SparseMerge;
using cuda::TiledBlock;

float rounded(Element16 element, float value) {
  return element == Element16::kBf16 ? float_of_bf16(bf16_of_float(value))
                                     : float_of_half(half_of_float(value));
}
uint16_t bits_of(Element16 element, float value) {
  return element == Element16::kBf16 ? bf16_of_float(value) : half_of_float(value);
}
float value_of(Element16 element, uint16_t bits) {
  return element == Element16::kBf16 ? float_of_bf16(bits) : float_of_half(bits);
}

/// 16-byte aligned storage of 16-bit elements.
struct Aligned {
  explicit Aligned(int64_t count) : size(count), pieces(static_cast<size_t>(count + 7) / 8) {}
  uint16_t* data() { return pieces.data()->elements; }

  struct alignas(16) Piece {
    uint16_t elements[8] = {};
  };
  int64_t size;
  std::vector<Piece> pieces;
};

/// How a merge's tensors lie in memory: axes in the order given, and unused elements between rows.
enum class Memory { kTokens, kHeads, kPadded };
Strides strides_of(const Spec& s, Memory memory) {
  if (memory == Memory::kHeads) return {s.heads * s.queries * s.dim, s.dim, s.queries * s.dim};
  const int64_t row = s.heads * s.dim + (memory == Memory::kPadded ? 24 : 0);
  return {s.queries * row, row, s.dim};
}

/// Inputs in a 16-bit type, exactly: a Problem whose f32 tensors hold rounded values.
Problem make_problem16(const Spec& spec, Element16 element, uint64_t seed) {
  Problem p = make_problem(spec, Element::kF32, seed);
  for (std::vector<float>* tensor : {&p.q, &p.k, &p.v})
    for (float& value : *tensor) value = rounded(element, value);
  return p;
}

Problem without_bias(Problem p) {
  p.spec.buckets.reset();
  return p;
}

/// f32 throughout in natural order, probabilities and outputs rounded to the 16-bit type.
Result plain16(const Problem& p, Element16 element) {
  const Arguments a = p.arguments(Element::kF32, const_cast<float*>(p.q.data()), nullptr);
  const Spec& s = p.spec;
  Result result;
  std::vector<float> score(static_cast<size_t>(s.keys));
  for (int64_t row = 0; row < p.num_rows(); ++row) {
    const int64_t i = row % s.queries, h = row / s.queries % s.heads, b = row / s.queries / s.heads;
    const float* q = p.q.data() + b * p.q_strides.batch + i * p.q_strides.token + h * p.q_strides.head;
    const int64_t base = b * p.k_strides.batch + h * p.k_strides.head;
    for (int64_t j = 0; j < s.keys; ++j) {
      float dot = 0;
      for (int64_t d = 0; d < s.dim; ++d)
        dot += q[d] * p.k[static_cast<size_t>(base + j * p.k_strides.token + d)];
      score[static_cast<size_t>(j)] = dot * a.scale;
    }
    for (const int32_t j : biased_keys(p.buckets, i)) score[static_cast<size_t>(j)] += a.beta;
    const float largest = *std::max_element(score.begin(), score.end());
    float sum = 0;
    for (float& value : score) {
      sum += value = std::exp(value - largest);
      value = rounded(element, value);
    }
    for (int64_t d = 0; d < s.dim; ++d) {
      float out = 0;
      for (int64_t j = 0; j < s.keys; ++j)
        out += score[static_cast<size_t>(j)] * p.v[static_cast<size_t>(base + j * p.k_strides.token + d)];
      result.out.push_back(static_cast<double>(rounded(element, out / sum)));
    }
    result.log_sum_exp.push_back(static_cast<double>(largest + std::log(sum)));
  }
  return result;
}

struct Merged {
  Result result;               // rows in the order of Result
  std::vector<uint16_t> bits;  // of the output
  EmulationReport report;
};

constexpr uint16_t kUntouched = 0x5a5a;

/// sparse_merge of `dense`, rounded to the 16-bit type, on the emulated GPU.
Merged merge(const Problem& p, const Result& dense, Element16 element, Memory memory = Memory::kTokens,
             const Schedule& schedule = {}) {
  const Spec& s = p.spec;
  const Strides strides = strides_of(s, memory);
  Aligned q(s.batch * strides.batch), k(q.size), v(q.size), out(q.size);
  std::fill_n(out.data(), out.size, kUntouched);
  std::vector<float> log_sum_exp(static_cast<size_t>(p.num_rows()));
  size_t row = 0;
  for (int64_t b = 0; b < s.batch; ++b)
    for (int64_t h = 0; h < s.heads; ++h)
      for (int64_t i = 0; i < s.queries; ++i, ++row) {
        log_sum_exp[row] = static_cast<float>(dense.log_sum_exp[row]);
        const auto from = [&](const Strides& x) {
          return static_cast<size_t>(b * x.batch + i * x.token + h * x.head);
        };
        for (size_t d = 0; d < static_cast<size_t>(s.dim); ++d) {
          const size_t to = from(strides) + d;
          q.data()[to] = bits_of(element, p.q[from(p.q_strides) + d]);
          k.data()[to] = bits_of(element, p.k[from(p.k_strides) + d]);
          v.data()[to] = bits_of(element, p.v[from(p.k_strides) + d]);
          out.data()[to] =
              bits_of(element, static_cast<float>(dense.out[row * static_cast<size_t>(s.dim) + d]));
        }
      }

  const BiasTiles tiles = cuda::make_bias_tiles(p.buckets);
  SparseMerge m;
  m.shape = {s.batch, s.queries, s.keys, s.heads, s.dim};
  m.element = element;
  m.q = q.data(), m.k = k.data(), m.v = v.data(), m.out = out.data();
  m.log_sum_exp = log_sum_exp.data();
  m.q_strides = m.k_strides = m.v_strides = m.out_strides = strides;
  m.log_sum_exp_strides = {s.heads * s.queries, 1, s.queries};
  m.scale = p.arguments(Element::kF32, const_cast<float*>(p.q.data()), nullptr).scale;
  m.beta = s.buckets->beta;
  m.blocks = tiles.blocks.data(), m.keys = tiles.keys.data(), m.masks = tiles.masks.data();
  m.num_blocks = static_cast<int32_t>(tiles.blocks.size()), m.row_stride = tiles.row_stride;

  Merged merged;
  merged.report = emulate_sparse_merge(m, {q.size, k.size, v.size}, schedule);
  for (int64_t b = 0; b < s.batch; ++b)
    for (int64_t h = 0; h < s.heads; ++h)
      for (int64_t i = 0; i < s.queries; ++i)
        for (int64_t d = 0; d < s.dim; ++d) {
          uint16_t& bits = out.data()[b * strides.batch + i * strides.token + h * strides.head + d];
          merged.bits.push_back(bits);
          merged.result.out.push_back(static_cast<double>(value_of(element, bits)));
          bits = kUntouched;
        }
  EXPECT_TRUE(std::all_of(out.data(), out.data() + out.size, [](uint16_t b) { return b == kUntouched; }))
      << "wrote between rows";
  merged.result.log_sum_exp.assign(log_sum_exp.begin(), log_sum_exp.end());
  return merged;
}

Spec spec_of(int64_t batch, int64_t heads, int64_t dim, float deviation, BucketSpec buckets) {
  return {batch, heads, 0, 0, dim, Layout::kTokens, deviation, buckets};
}

void expect_twice_plain(const Problem& p, const Result& found, Element16 element) {
  const Result exact = truth(p), simple = plain16(p, element);
  double largest = 0;
  for (const double value : exact.out) largest = std::max(largest, std::abs(value));
  const double unit = largest * (element == Element16::kF16 ? 0x1p-11 : 0x1p-8);
  const Difference ours = difference(found.out, exact.out), theirs = difference(simple.out, exact.out);
  EXPECT_LE(ours.max, 2 * theirs.max + unit);
  EXPECT_LE(ours.rms, 2 * theirs.rms + unit / 4);
  double largest_sum = 1;
  for (const double value : exact.log_sum_exp) largest_sum = std::max(largest_sum, std::abs(value));
  EXPECT_LE(difference(found.log_sum_exp, exact.log_sum_exp).max, largest_sum * 0x1p-21);
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
      make_problem16(spec_of(1, 1, 16, 1, {3, 16, 16, 4, Landing::kProjected, 1}), Element16::kBf16, 5);
  const BiasTiles tiles = cuda::make_bias_tiles(p.buckets);
  const int64_t per_tile = 4 /*warps*/ * (3 * 4 + 2 * 5) /*of 16 dimensions padded to 40*/;
  const Merged merged = merge(p, truth(without_bias(p)), Element16::kBf16);
  EXPECT_LT(static_cast<double>(merged.report.multiplications),
            0.85 * static_cast<double>(tiles.num_tiles() * per_tile));
}

// ----------------------------------------------------------------------------------------------- numbers

struct Case {
  Spec spec;
  Element16 element = Element16::kBf16;
  Memory memory = Memory::kTokens;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  const auto add = [&](Spec spec, Element16 element = Element16::kBf16, Memory memory = Memory::kTokens) {
    all.push_back({spec, element, memory});
  };
  constexpr Element16 kBf16 = Element16::kBf16, kF16 = Element16::kF16;
  const BucketSpec odd_views{2, 9, 7, 2, Landing::kProjected, 1.8f};
  // Every compiled size, and head dimensions that each of them pads.
  for (const int64_t dim : {8, 16, 24, 40, 48, 64, 72, 80, 88, 96, 104, 128, 136, 160, 168, 192, 200, 256})
    add(spec_of(1, 1, dim, 1, {2, 5, 6, 2, Landing::kProjected, 1.8f}), dim % 16 == 0 ? kBf16 : kF16);
  for (const int64_t dim : {40, 80, 160})
    for (const Element16 element : {kBf16, kF16}) add(spec_of(1, 2, dim, 1, odd_views), element);
  // Layouts, batches and heads.
  for (const Memory memory : {Memory::kTokens, Memory::kHeads, Memory::kPadded})
    add(spec_of(2, 3, 40, 1, {2, 5, 9, 1, Landing::kProjected, 1.8f}), kBf16, memory);
  // Grids: one pixel, one view, views of full blocks, windows of all four levels and larger than a view.
  add(spec_of(1, 1, 40, 1, {1, 1, 1, 0, Landing::kEverywhere, 1.8f}));
  add(spec_of(1, 1, 40, 1, {3, 1, 1, 0, Landing::kProjected, 1.8f}));
  add(spec_of(1, 1, 40, 1, {2, 8, 8, 4, Landing::kProjected, 1.8f}));
  add(spec_of(1, 1, 40, 1, {1, 20, 20, 3, Landing::kProjected, 1.8f}));
  add(spec_of(1, 1, 80, 1, {3, 4, 6, 0, Landing::kProjected, 1.8f}));
  add(spec_of(1, 1, 40, 1, {2, 6, 6, 30, Landing::kProjected, 1.8f}));
  add(spec_of(1, 1, 40, 1, {2, 17, 3, 1, Landing::kProjected, 1.8f}));
  // Biases, to where unbiased keys vanish and to the limits; rows with no, some and all keys biased; keys in
  // many cells.
  for (const float beta : {1e-6f, 1e-3f, 0.3f, 3.5f, 8.0f, 20.0f, 100.0f, 1e4f, -1e-3f, -0.3f, -1.0f})
    for (const Landing landing : {Landing::kNone, Landing::kProjected, Landing::kEverywhere})
      add(spec_of(1, 1, 40, 1, {2, 5, 4, 1, landing, beta}), beta == 8 || beta == 100 ? kF16 : kBf16);
  // Score ranges: nearly equal weights, and nearly one-hot.
  for (const float deviation : {0.01f, 10.0f, 50.0f})
    for (const float beta : {-0.5f, 2.0f, 12.0f})
      add(spec_of(1, 1, 40, deviation, {2, 7, 7, 2, Landing::kProjected, beta}),
          deviation == 10 ? kF16 : kBf16);
  return all;
}

class SparseMergeCase : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(All, SparseMergeCase, testing::ValuesIn(cases()),
                         [](const auto& test_info) { return std::to_string(test_info.index); });

void PrintTo(const Case& c, std::ostream* out) {
  PrintTo(c.spec, out);
  *out << (c.element == Element16::kBf16 ? ", bf16" : ", f16") << ", memory " << static_cast<int>(c.memory);
}

TEST_P(SparseMergeCase, error_is_at_most_twice_that_of_a_plain_version) {
  const auto& [spec, element, memory] = GetParam();
  const Problem p = make_problem16(spec, element, 1);
  const Merged merged = merge(p, truth(without_bias(p)), element, memory);
  expect_twice_plain(p, merged.result, element);
  EXPECT_EQ(merged.report.conflicts, 0);
}

TEST(SparseMerge, does_not_depend_on_when_copies_arrive_or_which_warp_is_ahead) {
  for (const int64_t dim : {40, 80, 160})  // three, three and two buffers; queries in registers and not
    for (const float beta : {1.8f, 30.0f}) {
      const Problem p =
          make_problem16(spec_of(1, 1, dim, 1, {2, 9, 8, 4, Landing::kProjected, beta}), Element16::kBf16, 2);
      const Result dense = truth(without_bias(p));
      const Merged expected = merge(p, dense, Element16::kBf16);
      expect_twice_plain(p, expected.result, Element16::kBf16);
      for (const bool late : {false, true})
        for (const bool last_first : {false, true}) {
          const Merged found = merge(p, dense, Element16::kBf16, Memory::kTokens, {late, last_first});
          EXPECT_EQ(found.bits, expected.bits) << late << last_first;
          EXPECT_EQ(found.result.log_sum_exp, expected.result.log_sum_exp) << late << last_first;
        }
    }
}

TEST(SparseMerge, keeps_every_bit_of_rows_without_biased_keys) {
  for (const float beta : {2.0f, 50.0f, -0.7f}) {
    const Problem p =
        make_problem16(spec_of(1, 2, 40, 1, {2, 9, 7, 0, Landing::kProjected, beta}), Element16::kBf16, 3);
    const Result dense = truth(without_bias(p));
    const Merged found = merge(p, dense, Element16::kBf16);
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
      make_problem16(spec_of(1, 1, 40, 1, {2, 5, 4, 1, Landing::kProjected, 1.8f}), Element16::kBf16, 4);
  const Result dense = truth(without_bias(p));
  const int32_t key = p.buckets.keys[p.buckets.keys.size() / 2];
  p.k[static_cast<size_t>(key) * 40 + 39] = nan;
  const Merged found = merge(p, dense, Element16::kBf16);
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
        make_problem16(spec_of(1, 1, 16, 1, {1, 6, 6, 1, Landing::kProjected, beta}), Element16::kBf16, 5);
    for (size_t i = 0; i < 36; ++i) p.q[i * 16] = 1;
    for (size_t j = 0; j < 30; ++j) p.k[j * 16] = -inf;  // most keys have no weight
    const Merged found = merge(p, truth(without_bias(p)), Element16::kBf16);
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
