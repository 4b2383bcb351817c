// The contract of attention.h, for every instruction set and element type: shapes × biases against the
// float64 definition, with the error of a plain same-precision version as the yardstick.
#include "patina/attention/attention.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>

#include <gtest/gtest.h>

#include "patina/base/bf16.h"
#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "problem.h"

namespace patina::attention::test {
namespace {

struct Implementation {
  CpuIsa isa;
  Element element;
};
const Implementation kImplementations[] = {
    {CpuIsa::kGeneric, Element::kF32},     {CpuIsa::kGeneric, Element::kBf16},
    {CpuIsa::kAvx2, Element::kF32},        {CpuIsa::kAvx2, Element::kBf16},
    {CpuIsa::kAvx512, Element::kF32},      {CpuIsa::kAvx512, Element::kBf16},
    {CpuIsa::kAvx512Bf16, Element::kBf16}, {CpuIsa::kAmxBf16, Element::kBf16},
};

bool supported(const Implementation& implementation) {
  for (const CpuIsa isa : supported_isas(implementation.element))
    if (isa == implementation.isa) return true;
  return false;
}
#define PATINA_REQUIRE_ISA(implementation) \
  if (!supported(implementation))          \
  GTEST_SKIP() << "this processor does not run " << name_of((implementation).isa)

std::string implementation_name(const Implementation& implementation) {
  std::string name =
      std::string(name_of(implementation.isa)) + (implementation.element == Element::kF32 ? "_f32" : "_bf16");
  for (char& c : name)
    if (c == '-') c = '_';
  return name;
}

void PrintTo(const Implementation& implementation, std::ostream* out) {
  *out << implementation_name(implementation);
}

std::vector<Spec> dense_specs() {
  std::vector<Spec> specs;
  const auto add = [&](int64_t batch, int64_t heads, int64_t queries, int64_t keys, int64_t dim,
                       Layout layout, float deviation) {
    specs.push_back({batch, heads, queries, keys, dim, layout, deviation, std::nullopt});
  };
  // Head dimensions of the networks, and others: multiples of 8, odd, one.
  for (const int64_t dim : {1, 3, 7, 8, 16, 20, 24, 32, 33, 40, 48, 56, 64, 80, 96, 100, 128, 160, 200, 256})
    add(1, 2, 70, 101, dim, Layout::kTokens, 1);
  // Lengths around the tiles (6, 16, 32, 64, 96 and their neighbours), and one.
  for (const int64_t length :
       {1, 2, 5, 6, 7, 15, 16, 17, 31, 32, 33, 63, 64, 65, 95, 96, 97, 127, 128, 129, 191, 192, 193, 289})
    add(1, 1, length, length, 40, Layout::kHeads, 1);
  add(1, 1, 1, 400, 40, Layout::kTokens, 1);
  add(1, 1, 400, 1, 40, Layout::kTokens, 1);
  add(2, 3, 65, 77, 40, Layout::kFused, 1);  // cross-attention to 77 tokens
  add(3, 2, 50, 98, 24, Layout::kFused, 1);
  add(2, 2, 64, 96, 80, Layout::kHeads, 1);
  add(1, 5, 130, 40, 17, Layout::kFused, 1);
  for (const float deviation : {0.01f, 4.0f, 20.0f, 100.0f})
    add(1, 2, 90, 150, 40, Layout::kTokens, deviation);
  return specs;
}

std::vector<Spec> biased_specs() {
  std::vector<Spec> specs;
  const auto add = [&](int64_t batch, int64_t heads, int64_t dim, Layout layout, float deviation,
                       BucketSpec buckets) {
    specs.push_back({batch, heads, 0, 0, dim, layout, deviation, buckets});
  };
  // Grids, views that do not divide into 8 × 8 blocks, windows of all four levels and beyond.
  add(1, 1, 8, Layout::kTokens, 1, {1, 1, 1, 0, Landing::kEverywhere, 1.8f});
  add(1, 1, 40, Layout::kTokens, 1, {3, 1, 1, 0, Landing::kProjected, 1.8f});
  add(1, 2, 40, Layout::kTokens, 1, {2, 8, 8, 4, Landing::kProjected, 1.8f});
  add(1, 2, 16, Layout::kHeads, 1, {2, 9, 7, 2, Landing::kProjected, 1.8f});
  add(2, 2, 24, Layout::kFused, 1, {2, 5, 3, 1, Landing::kProjected, 1.8f});
  add(1, 1, 32, Layout::kTokens, 1, {3, 4, 6, 0, Landing::kProjected, 1.8f});
  add(1, 1, 80, Layout::kTokens, 1, {2, 10, 13, 4, Landing::kProjected, 1.8f});
  add(1, 1, 40, Layout::kTokens, 1, {2, 17, 9, 4, Landing::kProjected, 1.8f});
  add(1, 1, 160, Layout::kTokens, 1, {4, 3, 3, 1, Landing::kProjected, 1.8f});
  add(1, 1, 40, Layout::kTokens, 1, {1, 20, 20, 3, Landing::kProjected, 1.8f});
  add(1, 1, 40, Layout::kTokens, 1, {2, 6, 6, 30, Landing::kProjected, 1.8f});
  // Biases of both signs, to where unbiased keys vanish and to the largest allowed; rows with no, some and
  // all keys biased.
  for (const float beta :
       {0.0f, 1e-3f, 0.3f, 3.5f, 20.0f, 100.0f, 1e4f, -0.3f, -3.5f, -20.0f, -100.0f, -1e4f})
    for (const Landing landing : {Landing::kNone, Landing::kProjected, Landing::kEverywhere})
      add(1, 1, 40, Layout::kTokens, 1, {2, 5, 4, 1, landing, beta});
  for (const float deviation : {0.01f, 10.0f, 50.0f})
    for (const float beta : {-2.0f, 2.0f})
      add(1, 2, 40, Layout::kTokens, deviation, {2, 7, 7, 2, Landing::kProjected, beta});
  return specs;
}

std::vector<Spec> all_specs() {
  std::vector<Spec> specs = dense_specs();
  for (const Spec& spec : biased_specs()) specs.push_back(spec);
  return specs;
}

/// attention.h: this kernel's log-sum-exp has the precision of bf16 weights.
bool sums_rounded_weights(CpuIsa isa) {
  return isa == CpuIsa::kAmxBf16;
}

class AttentionCase : public testing::TestWithParam<std::tuple<Implementation, Spec>> {};

TEST_P(AttentionCase, error_is_at_most_twice_that_of_a_plain_version) {
  const auto& [implementation, spec] = GetParam();
  PATINA_REQUIRE_ISA(implementation);
  const Problem problem = make_problem(spec, implementation.element, 1);
  const Result exact = truth(problem), simple = plain(problem), found = run(problem, implementation.isa);

  double largest = 0;
  for (const double value : exact.out) largest = std::max(largest, std::abs(value));
  // One unit in the last place of the largest output: where the plain version happens to be exact (one key),
  // a rounding is allowed.
  const double unit = largest * (implementation.element == Element::kF32 ? 0x1p-23 : 0x1p-8);
  const Difference ours = difference(found.out, exact.out), theirs = difference(simple.out, exact.out);
  EXPECT_LE(ours.max, 2 * theirs.max + unit);
  EXPECT_LE(ours.rms, 2 * theirs.rms + unit / 4);

  double largest_sum = 1;
  for (const double value : exact.log_sum_exp) largest_sum = std::max(largest_sum, std::abs(value));
  EXPECT_LE(difference(found.log_sum_exp, exact.log_sum_exp).max,
            2 * difference(simple.log_sum_exp, exact.log_sum_exp).max + largest_sum * 0x1p-22 +
                (sums_rounded_weights(implementation.isa) ? 0x1p-7 : 0));
}

INSTANTIATE_TEST_SUITE_P(
    All, AttentionCase, testing::Combine(testing::ValuesIn(kImplementations), testing::ValuesIn(all_specs())),
    [](const auto& test_info) {
      return implementation_name(std::get<0>(test_info.param)) + "_" + std::to_string(test_info.index);
    });

class AttentionContract : public testing::TestWithParam<Implementation> {};
INSTANTIATE_TEST_SUITE_P(All, AttentionContract, testing::ValuesIn(kImplementations),
                         [](const auto& test_info) { return implementation_name(test_info.param); });

std::vector<double> both(const Result& result) {
  std::vector<double> values = result.out;
  values.insert(values.end(), result.log_sum_exp.begin(), result.log_sum_exp.end());
  return values;
}

TEST_P(AttentionContract, beta_zero_is_bit_equal_to_no_bias) {
  PATINA_REQUIRE_ISA(GetParam());
  for (const BucketSpec& buckets : {BucketSpec{2, 9, 7, 2, Landing::kProjected, 0.0f},
                                    BucketSpec{1, 13, 8, 1, Landing::kEverywhere, 0.0f}}) {
    Spec spec;
    spec.dim = 40;
    spec.heads = 2;
    spec.buckets = buckets;
    Problem problem = make_problem(spec, GetParam().element, 2);
    const Result with = run(problem, GetParam().isa);
    problem.spec.buckets.reset();
    EXPECT_EQ(both(run(problem, GetParam().isa)), both(with));
  }
}

TEST_P(AttentionContract, an_empty_bias_is_bit_equal_to_no_bias) {
  PATINA_REQUIRE_ISA(GetParam());
  Spec spec;
  spec.dim = 40;
  spec.heads = 2;
  spec.buckets =
      BucketSpec{2, 9, 7, 2, Landing::kNone, 2.0f};  // 8 × 8 blocks of queries instead of runs of 64
  Problem problem = make_problem(spec, GetParam().element, 2);
  const Result with = run(problem, GetParam().isa);
  problem.spec.buckets.reset();
  EXPECT_EQ(both(run(problem, GetParam().isa)), both(with));
}

TEST_P(AttentionContract, results_do_not_depend_on_threads) {
  PATINA_REQUIRE_ISA(GetParam());
  Spec spec{2, 3, 0, 0, 24, Layout::kTokens, 1, BucketSpec{2, 9, 9, 2, Landing::kProjected, 1.5f}};
  const Problem problem = make_problem(spec, GetParam().element, 4);
  set_num_threads(1);
  const Result one = run(problem, GetParam().isa);
  set_num_threads(0);
  EXPECT_EQ(both(run(problem, GetParam().isa)), both(one));
}

TEST_P(AttentionContract, a_row_depends_on_its_own_query_alone) {
  PATINA_REQUIRE_ISA(GetParam());
  const Problem all =
      make_problem({1, 1, 150, 130, 40, Layout::kTokens, 1, std::nullopt}, GetParam().element, 5);
  const Result expected = run(all, GetParam().isa);
  for (const int64_t row : {0, 63, 64, 149}) {
    Problem one = all;
    one.spec.queries = 1;
    const ptrdiff_t at = static_cast<ptrdiff_t>(row * 40);
    one.q.assign(all.q.begin() + at, all.q.begin() + at + 40);
    if (!all.q16.empty()) one.q16.assign(all.q16.begin() + at, all.q16.begin() + at + 40);
    one.q_strides = one.out_strides = {40, 40, 40};
    const Result found = run(one, GetParam().isa);
    EXPECT_EQ(found.out, std::vector<double>(expected.out.begin() + at, expected.out.begin() + at + 40))
        << row;
  }
}

/// Writes `value` into one element of a problem's tensor in both element types.
void poke(std::vector<float>& tensor, std::vector<uint16_t>& tensor16, size_t at, float value) {
  tensor[at] = value;
  if (!tensor16.empty()) tensor16[at] = bf16_of_float(value);
}

TEST_P(AttentionContract, nan_in_a_query_or_key_gives_nan_in_the_rows_that_read_it) {
  PATINA_REQUIRE_ISA(GetParam());
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const auto nan_rows = [](const Result& result) {
    size_t rows = 0;
    for (size_t row = 0; row < result.out.size() / 40; ++row) {
      size_t count = 0;
      for (size_t d = 0; d < 40; ++d) count += std::isnan(result.out[row * 40 + d]);
      EXPECT_TRUE(count == 0 || count == 40) << "row " << row;
      rows += count > 0;
    }
    return rows;
  };
  const Problem clean =
      make_problem({1, 1, 70, 110, 40, Layout::kTokens, 1, std::nullopt}, GetParam().element, 6);
  EXPECT_EQ(nan_rows(run(clean, GetParam().isa)), 0u);

  Problem query = clean;
  poke(query.q, query.q16, 65 * 40 + 3, nan);
  EXPECT_EQ(nan_rows(run(query, GetParam().isa)), 1u);
  EXPECT_EQ(nan_rows(truth(query)), 1u);

  for (const size_t key : {size_t{0}, size_t{95}, size_t{109}}) {
    Problem keys = clean;
    poke(keys.k, keys.k16, key * 40 + 7, nan);
    EXPECT_EQ(nan_rows(run(keys, GetParam().isa)), 70u);
  }

  // An infinite query makes scores of both infinities: NaN, in its row alone.
  Problem infinite = clean;
  poke(infinite.q, infinite.q16, 9 * 40, inf);
  EXPECT_EQ(nan_rows(run(infinite, GetParam().isa)), 1u);
  EXPECT_EQ(nan_rows(truth(infinite)), 1u);
}

TEST_P(AttentionContract, a_score_of_minus_infinity_has_no_weight) {
  PATINA_REQUIRE_ISA(GetParam());
  const float inf = std::numeric_limits<float>::infinity();
  Problem problem =
      make_problem({1, 1, 20, 200, 16, Layout::kTokens, 1, std::nullopt}, GetParam().element, 7);
  for (size_t i = 0; i < 20; ++i) poke(problem.q, problem.q16, i * 16, 1.0f);
  // All keys of the first tiles, so that a row's maximum stays -inf for a while.
  for (size_t j = 0; j < 150; ++j) poke(problem.k, problem.k16, j * 16, -inf);
  const Result exact = truth(problem), found = run(problem, GetParam().isa);
  EXPECT_LE(difference(found.out, exact.out).max, GetParam().element == Element::kF32 ? 2e-6 : 2e-2);
  EXPECT_LE(difference(found.log_sum_exp, exact.log_sum_exp).max, 1e-5);

  for (size_t j = 150; j < 200; ++j) poke(problem.k, problem.k16, j * 16, -inf);
  for (const double value : run(problem, GetParam().isa).out) ASSERT_TRUE(std::isnan(value));
  for (const double value : truth(problem).out) ASSERT_TRUE(std::isnan(value));
}

TEST_P(AttentionContract, sums_over_262144_keys_keep_their_precision) {
  PATINA_REQUIRE_ISA(GetParam());
  constexpr int64_t kKeys = 262'144;
  const Problem problem =
      make_problem({1, 1, 3, kKeys, 8, Layout::kTokens, 0.5f, std::nullopt}, GetParam().element, 8);
  const Result exact = truth(problem), simple = plain(problem), found = run(problem, GetParam().isa);
  // Sums in tiles must do better than the plain version's one long sum; in bf16 the rounding of the terms and
  // outputs dominates both.
  const Difference ours = difference(found.out, exact.out), theirs = difference(simple.out, exact.out);
  EXPECT_LE(ours.max, theirs.max * (GetParam().element == Element::kF32 ? 0.5 : 1.5));
  EXPECT_LE(difference(found.log_sum_exp, exact.log_sum_exp).max,
            sums_rounded_weights(GetParam().isa) ? 0x1p-12 : 2e-6);
}

/// The fastest implementation of each element at full size; sanitised code takes minutes for it and gets
/// less.
#ifdef __SANITIZE_ADDRESS__
constexpr int kViewSize = 16;
#else
constexpr int kViewSize = 64;
#endif
class LargestGrid : public testing::TestWithParam<Element> {};
INSTANTIATE_TEST_SUITE_P(All, LargestGrid, testing::Values(Element::kF32, Element::kBf16),
                         [](const auto& test_info) {
                           return test_info.param == Element::kF32 ? "f32" : "bf16";
                         });

TEST_P(LargestGrid, of_nine_512_pixel_views_is_right_at_sampled_rows) {
  const Element element = GetParam();
  Spec spec{
      1, 1, 0, 0, 8, Layout::kTokens, 1, BucketSpec{3, kViewSize, kViewSize, 4, Landing::kProjected, 1.8f}};
  const Problem problem = make_problem(spec, element, 9);
  const int64_t num_keys = problem.spec.keys;
  ASSERT_EQ(num_keys, 9 * kViewSize * kViewSize);
  const Result found = run(problem, supported_isas(element).back());

  for (const int64_t row : {int64_t{0}, int64_t{63}, int64_t{64}, num_keys / 3 + 57, num_keys - 1}) {
    std::vector<double> weight(static_cast<size_t>(num_keys));
    for (size_t j = 0; j < weight.size(); ++j)
      for (size_t d = 0; d < 8; ++d)
        weight[j] += static_cast<double>(problem.q[static_cast<size_t>(row) * 8 + d]) *
                     static_cast<double>(problem.k[j * 8 + d]);
    for (double& value : weight) value /= std::sqrt(8.0);
    for (const int32_t j : biased_keys(problem.buckets, row)) weight[static_cast<size_t>(j)] += 1.8;
    double sum = 0;
    for (double& value : weight) sum += value = std::exp(value);
    for (size_t d = 0; d < 8; ++d) {
      double expected = 0;
      for (size_t j = 0; j < weight.size(); ++j)
        expected += weight[j] * static_cast<double>(problem.v[j * 8 + d]);
      EXPECT_NEAR(found.out[static_cast<size_t>(row) * 8 + d], expected / sum,
                  element == Element::kF32 ? 2e-7 : 1e-3);
    }
    EXPECT_NEAR(found.log_sum_exp[static_cast<size_t>(row)], std::log(sum),
                sums_rounded_weights(supported_isas(element).back()) ? 0x1p-12 : 1e-5);
  }
}

TEST(Attention, refuses_an_instruction_set_for_an_element_it_does_not_take) {
  const Problem problem = make_problem({1, 1, 4, 4, 8, Layout::kTokens, 1, std::nullopt}, Element::kF32, 1);
  std::vector<float> out(problem.out_size());
  EXPECT_THROW(attention_cpu(problem.arguments(Element::kF32, out.data(), nullptr), CpuIsa::kAmxBf16), Error);
}

TEST(Attention, the_default_is_the_last_supported_instruction_set) {
  for (const Element element : {Element::kF32, Element::kBf16}) {
    const Problem problem = make_problem({1, 2, 70, 90, 40, Layout::kTokens, 1, std::nullopt}, element, 1);
    std::vector<float> a(problem.out_size()), b(problem.out_size());
    attention_cpu(problem.arguments(element, a.data(), nullptr));
    attention_cpu(problem.arguments(element, b.data(), nullptr), supported_isas(element).back());
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * (element == Element::kF32 ? 4 : 2)), 0);
  }
}

}  // namespace
}  // namespace patina::attention::test
