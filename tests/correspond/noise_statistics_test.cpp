// The statistics must find what is wrong with noise that is wrong in known ways.
#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/base/random.h"
#include "patina/correspond/noise.h"

namespace patina::correspond {
namespace {

// grid × grid views of 64 × 64 latent pixels; value(index) makes each number.
template <class F>
NoiseField field_of(int grid, const F& value) {
  NoiseField noise;
  noise.width = noise.height = grid * 64;
  noise.values.resize(4 * static_cast<size_t>(noise.width) * static_cast<size_t>(noise.height));
  for (size_t i = 0; i < noise.values.size(); ++i) noise.values[i] = value(i);
  return noise;
}
float white(size_t i) {
  return gaussian4(5, RandomPurpose::kTest, i)[0];
}

TEST(NoiseStatistics, white_noise_passes) {
  const auto all = noise_statistics(field_of(3, white), 3);
  ASSERT_EQ(all.size(), 9u);
  for (const NoiseStatistics& s : all) {
    // Four standard deviations for 16,384 numbers.
    EXPECT_NEAR(s.mean, 0.0f, 0.032f);
    EXPECT_NEAR(s.variance, 1.0f, 0.045f);
    EXPECT_NEAR(s.autocorrelation_x, 0.0f, 0.032f);
    EXPECT_NEAR(s.autocorrelation_y, 0.0f, 0.032f);
    EXPECT_GT(s.kolmogorov_smirnov_p, 0.001f);
  }
}

TEST(NoiseStatistics, p_values_of_white_noise_are_uniform) {
  // Sixteen views of four seeds: the mean of 64 uniform numbers is ½ ± 0.036.
  double sum = 0;
  for (size_t seed = 0; seed < 4; ++seed)
    for (const auto& s :
         noise_statistics(field_of(4, [&](size_t i) { return white(i + seed * 1000000); }), 4))
      sum += s.kolmogorov_smirnov_p;
  EXPECT_NEAR(sum / 64.0, 0.5, 4 * 0.036);
}

TEST(NoiseStatistics, shifted_scaled_and_uniform_numbers_are_found) {
  const auto shifted = noise_statistics(field_of(1, [](size_t i) { return white(i) + 0.1f; }), 1)[0];
  EXPECT_NEAR(shifted.mean, 0.1f, 0.03f);
  EXPECT_LT(shifted.kolmogorov_smirnov_p, 1e-6f);
  const auto scaled = noise_statistics(field_of(1, [](size_t i) { return 1.1f * white(i); }), 1)[0];
  EXPECT_NEAR(scaled.variance, 1.21f, 0.05f);
  EXPECT_LT(scaled.kolmogorov_smirnov_p, 1e-3f);
  const auto uniform = noise_statistics(field_of(1,
                                                 [](size_t i) {
                                                   const float u =
                                                       RandomStream(3, RandomPurpose::kTest, i).uniform();
                                                   return std::sqrt(12.0f) * (u - 0.5f);
                                                 }),
                                        1)[0];
  EXPECT_NEAR(uniform.variance, 1.0f, 0.03f);
  EXPECT_LT(uniform.kolmogorov_smirnov_p, 1e-6f);
}

TEST(NoiseStatistics, neighbours_that_share_a_number_are_found_in_their_direction) {
  const auto along_x = noise_statistics(
      field_of(1, [](size_t i) { return (white(i) + white(i + 1)) / std::sqrt(2.0f); }), 1)[0];
  EXPECT_NEAR(along_x.autocorrelation_x, 0.5f, 0.03f);
  EXPECT_NEAR(along_x.autocorrelation_y, 0.0f, 0.04f);
  const auto along_y = noise_statistics(
      field_of(1, [](size_t i) { return (white(i) + white(i + 64)) / std::sqrt(2.0f); }), 1)[0];
  EXPECT_NEAR(along_y.autocorrelation_x, 0.0f, 0.04f);
  EXPECT_NEAR(along_y.autocorrelation_y, 0.5f, 0.03f);
}

TEST(NoiseStatistics, views_are_told_apart) {
  // View 2 of a 2 × 2 grid (lower left) is constant.
  const auto all = noise_statistics(field_of(2,
                                             [](size_t i) {
                                               const size_t x = i % 128, y = i / 128 % 128;
                                               return x < 64 && y >= 64 ? 7.0f : white(i);
                                             }),
                                    2);
  EXPECT_EQ(all[2].mean, 7.0f);
  EXPECT_EQ(all[2].variance, 0.0f);
  EXPECT_EQ(all[2].autocorrelation_x, 0.0f);
  for (const size_t other : {0u, 1u, 3u}) EXPECT_NEAR(all[other].mean, 0.0f, 0.04f);
}

TEST(NoiseStatistics, a_mask_leaves_out_pixels_and_their_neighbourhoods) {
  // View 0: columns repeat in the right half, which the mask leaves out; view 3 is left out wholly.
  const NoiseField noise = field_of(2, [](size_t i) { return white(i % 128 < 32 ? i : i / 2 * 2); });
  std::vector<uint8_t> mask(128 * 128);
  for (size_t i = 0; i < mask.size(); ++i) {
    const size_t x = i % 128, y = i / 128;
    mask[i] = y < 64 && x < 64 ? x < 32 : x < 64 || y < 64;
  }
  const auto all = noise_statistics(noise, 2, mask);
  EXPECT_EQ(all[0].num_values, 4 * 32 * 64);
  EXPECT_NEAR(all[0].autocorrelation_x, 0.0f, 0.045f);
  EXPECT_NEAR(all[1].autocorrelation_x, 0.5f, 0.045f);
  EXPECT_EQ(all[3].num_values, 0);
  EXPECT_EQ(all[3].variance, 0.0f);
  EXPECT_EQ(noise_statistics(noise, 2)[0].num_values, 4 * 64 * 64);
}

TEST(NoiseStatistics, rejects_fields_that_cannot_be_cut_and_masks_of_other_sizes) {
  EXPECT_THROW(noise_statistics(field_of(1, white), 1, std::vector<uint8_t>(100, 1)), Error);
  EXPECT_THROW(noise_statistics(field_of(1, white), 3), Error);
  EXPECT_THROW(noise_statistics(NoiseField{}, 1), Error);
}

}  // namespace
}  // namespace patina::correspond
