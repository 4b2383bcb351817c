#include "patina/base/random.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace patina {
namespace {

using Block = std::array<uint32_t, 4>;

// Known answers of philox4x32-10, published with [Salmon2011] in Random123's kat_vectors.
TEST(Philox, gives_the_published_answers) {
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox({~0u, ~0u, ~0u, ~0u}, {~0u, ~0u}),
            (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Philox, flipping_any_input_bit_flips_about_half_of_the_output) {
  const Block counter{1, 2, 3, 4}, reference = philox(counter, {5, 6});
  for (int bit = 0; bit < 192; ++bit) {
    Block c = counter;
    std::array<uint32_t, 2> k{5, 6};
    (bit < 128 ? c[static_cast<size_t>(bit / 32)] : k[static_cast<size_t>(bit / 32 - 4)]) ^= 1u << (bit % 32);
    const Block out = philox(c, k);
    int flipped = 0;
    for (size_t i = 0; i < 4; ++i) flipped += __builtin_popcount(out[i] ^ reference[i]);
    EXPECT_GT(flipped, 64 - 34) << "bit " << bit;  // six standard deviations of a fair coin
    EXPECT_LT(flipped, 64 + 34) << "bit " << bit;
  }
}

TEST(UniformFromBits, covers_the_half_open_unit_interval) {
  EXPECT_EQ(uniform_from_bits(0), 0.0f);
  EXPECT_LT(uniform_from_bits(~0u), 1.0f);
  EXPECT_EQ(uniform_from_bits(~0u), 1.0f - 0x1p-24f);
  EXPECT_EQ(uniform_from_bits(1u << 31), 0.5f);
}

TEST(GaussianFromBits, is_finite_for_extreme_bits) {
  for (const uint32_t a : {0u, ~0u})
    for (const uint32_t b : {0u, ~0u})
      for (const float value : gaussian_from_bits({a, b, b, a})) {
        EXPECT_TRUE(std::isfinite(value));
        EXPECT_LE(std::abs(value), 5.8f);
      }
}

// Gaussian numbers of consecutive indices, as the noise field draws them.
std::vector<double> gaussian_samples(size_t blocks, uint64_t seed) {
  std::vector<double> out;
  for (uint64_t i = 0; i < blocks; ++i)
    for (const float value : gaussian4(seed, RandomPurpose::kTest, i)) out.push_back(value);
  return out;
}

TEST(Gaussian, has_the_moments_of_a_standard_normal) {
  const auto samples = gaussian_samples(250000, 11);
  const auto n = static_cast<double>(samples.size());
  double m1 = 0, m2 = 0, m3 = 0, m4 = 0;
  for (const double x : samples) m1 += x, m2 += x * x, m3 += x * x * x, m4 += x * x * x * x;
  // Four standard errors: the variances of x, x², x³, x⁴ are 1, 2, 15, 96.
  EXPECT_NEAR(m1 / n, 0, 4 * std::sqrt(1 / n));
  EXPECT_NEAR(m2 / n, 1, 4 * std::sqrt(2 / n));
  EXPECT_NEAR(m3 / n, 0, 4 * std::sqrt(15 / n));
  EXPECT_NEAR(m4 / n, 3, 4 * std::sqrt(96 / n));
}

TEST(Gaussian, passes_kolmogorov_smirnov) {
  auto samples = gaussian_samples(25000, 12);
  std::sort(samples.begin(), samples.end());
  const auto n = static_cast<double>(samples.size());
  double distance = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    const double cdf = 0.5 * std::erfc(-samples[i] / std::sqrt(2.0));
    distance = std::max({distance, cdf - static_cast<double>(i) / n, static_cast<double>(i + 1) / n - cdf});
  }
  EXPECT_LT(distance * std::sqrt(n), 1.63) << "critical value at 1 %";
}

TEST(Gaussian, the_four_numbers_of_a_block_and_neighbouring_indices_are_uncorrelated) {
  const auto samples = gaussian_samples(100000, 13);
  for (const size_t lag : {1u, 2u, 3u, 4u, 8u}) {
    double sum = 0;
    const size_t n = samples.size() - lag;
    for (size_t i = 0; i < n; ++i) sum += samples[i] * samples[i + lag];
    EXPECT_NEAR(sum / static_cast<double>(n), 0, 4 / std::sqrt(static_cast<double>(n))) << "lag " << lag;
  }
}

TEST(Gaussian, differs_by_seed_purpose_index_and_sub_index) {
  std::set<std::array<float, 4>> seen;
  for (const uint64_t seed : {uint64_t{0}, uint64_t{1}, uint64_t{1} << 32})
    for (const RandomPurpose purpose : {RandomPurpose::kTest, RandomPurpose::kNoiseField})
      for (const uint64_t index : {uint64_t{0}, uint64_t{1}, uint64_t{1} << 32, uint64_t{1} << 63})
        for (const uint32_t sub_index : {0u, 1u}) seen.insert(gaussian4(seed, purpose, index, sub_index));
  EXPECT_EQ(seen.size(), 3u * 2 * 4 * 2);
}

TEST(RandomStream, uniform_numbers_fill_the_interval_evenly) {
  RandomStream random(21, RandomPurpose::kTest, 0);
  constexpr int kBins = 64, kSamples = 200000;
  std::vector<double> count(kBins);
  for (int i = 0; i < kSamples; ++i) {
    const float u = random.uniform();
    ASSERT_GE(u, 0.0f);
    ASSERT_LT(u, 1.0f);
    ++count[static_cast<size_t>(u * kBins)];
  }
  double chi_squared = 0;
  for (const double c : count)
    chi_squared += (c - kSamples / kBins) * (c - kSamples / kBins) / (kSamples / kBins);
  EXPECT_LT(chi_squared, 92.0) << "63 degrees of freedom, 1 %";
}

TEST(RandomStream, repeats_itself_and_no_other_stream) {
  const auto draw = [](uint64_t seed, uint64_t index, uint32_t sub_index) {
    RandomStream random(seed, RandomPurpose::kTest, index, sub_index);
    std::vector<float> out;
    for (int i = 0; i < 9; ++i) out.push_back(random.uniform());
    return out;
  };
  EXPECT_EQ(draw(1, 2, 3), draw(1, 2, 3));
  EXPECT_NE(draw(1, 2, 3), draw(2, 2, 3));
  EXPECT_NE(draw(1, 2, 3), draw(1, 3, 3));
  EXPECT_NE(draw(1, 2, 3), draw(1, 2, 4));
}

TEST(RandomStream, gaussian_numbers_have_unit_variance) {
  RandomStream random(22, RandomPurpose::kTest, 0);
  double sum = 0, squares = 0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const double x = random.gaussian();
    sum += x, squares += x * x;
  }
  EXPECT_NEAR(sum / kSamples, 0, 4 * std::sqrt(1.0 / kSamples));
  EXPECT_NEAR(squares / kSamples, 1, 4 * std::sqrt(2.0 / kSamples));
}

// How many of the intervals (columns × rows of the unit square) hold exactly one of as many samples.
int boxes_with_one(const std::vector<vec2>& points, int columns, int rows) {
  std::vector<int> held(static_cast<size_t>(columns * rows));
  for (const vec2& p : points) {
    const int x = static_cast<int>(p.x * static_cast<float>(columns)),
              y = static_cast<int>(p.y * static_cast<float>(rows));
    ++held[static_cast<size_t>(y * columns + x)];
  }
  return static_cast<int>(std::count(held.begin(), held.end(), 1));
}

TEST(even_stream, every_draw_has_one_sample_in_every_box) {
  constexpr int kSamples = 64, kDraws = 12;
  for (uint64_t pixel = 0; pixel < 50; ++pixel) {
    std::vector<std::vector<vec2>> draws(kDraws);
    for (uint32_t s = 0; s < kSamples; ++s) {
      RandomStream random = RandomStream::even(3, RandomPurpose::kTest, pixel, s);
      for (int d = 0; d < kDraws; ++d)
        draws[static_cast<size_t>(d)].push_back(d % 3 ? random.uniform2() : vec2(random.uniform(), 0.0f));
    }
    for (int d = 0; d < kDraws; ++d) {
      for (int columns = d % 3 ? 1 : kSamples; columns <= kSamples; columns *= 2)
        EXPECT_EQ(boxes_with_one(draws[static_cast<size_t>(d)], columns, kSamples / columns), kSamples)
            << "draw " << d << ", " << columns << " columns";
    }
  }
}

TEST(even_stream, draws_and_indices_know_nothing_of_each_other) {
  // Sums over many indices of products of centred draws: of two draws of a sample, of one draw of two
  // samples' indices.
  constexpr int kIndices = 40000;
  constexpr uint32_t kSample = 5;
  double between_draws = 0, between_coordinates = 0, between_indices = 0, mean = 0;
  float last = 0.5f;
  for (uint64_t i = 0; i < kIndices; ++i) {
    RandomStream random = RandomStream::even(8, RandomPurpose::kTest, i, kSample);
    const float a = random.uniform() - 0.5f;
    const vec2 b = random.uniform2() - 0.5f;
    mean += a;
    between_draws += a * b.x;
    between_coordinates += b.x * b.y;
    between_indices += a * last;
    last = a;
  }
  const double bound =
      4.5 / 12 * std::sqrt(kIndices);  // standard deviations of a sum of products of variance 1/144
  EXPECT_LT(std::abs(mean), 4.5 * std::sqrt(kIndices / 12.0));
  EXPECT_LT(std::abs(between_draws), bound);
  EXPECT_LT(std::abs(between_coordinates), bound);
  EXPECT_LT(std::abs(between_indices), bound);
}

}  // namespace
}  // namespace patina
