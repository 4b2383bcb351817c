#include "bench_mini/texture_features.h"

#include <cmath>

#include <gtest/gtest.h>

#include "patina/base/random.h"

namespace patina::bench {
namespace {

constexpr int kSide = 64;
const Window kMiddle{8, 8, 48};

Image noise(uint64_t seed) {
  RandomStream random(seed, RandomPurpose::kTest, 0);
  Image out(kSide, kSide, 3);
  for (float& value : out.pixels) value = random.uniform();
  return out;
}
Image covered() {
  return Image(kSide, kSide, 1, 1.0f);
}

TEST(TextureFeatures, begin_with_the_colour_in_cielab) {
  Image red(kSide, kSide, 3);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) red.set_rgb(x, y, {1, 0, 0});
  const auto features = texture_features(texture_planes(red, covered()), kMiddle);
  // sRGB red under D65 as colorimetric tables give it: L 53.24, a 80.09, b 67.20; log deviations between.
  EXPECT_NEAR(features[0], 53.24, 0.05);
  EXPECT_NEAR(features[2], 80.09, 0.15);
  EXPECT_NEAR(features[4], 67.20, 0.15);
}

TEST(TextureFeatures, are_finite_on_one_colour) {
  for (const float level : {0.0f, 0.5f, 1.0f})
    for (const float f : texture_features(texture_planes(Image(kSide, kSide, 3, level), covered()), kMiddle))
      EXPECT_TRUE(std::isfinite(f));
}

TEST(TextureFeatures, see_nothing_of_what_lies_off_the_object) {
  Image coverage = covered(), picture = noise(1);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < 30; ++x) coverage.at(x, y)[0] = 0;
  Image other = picture;
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < 30; ++x) other.set_rgb(x, y, {1, 1, 0});
  EXPECT_EQ(texture_features(texture_planes(picture, coverage), kMiddle),
            texture_features(texture_planes(other, coverage), kMiddle));
}

TEST(TextureFeatures, of_a_turned_picture_differ_in_the_direction_of_streaks_alone) {
  // Streaks that stand upright, so that there is a direction.
  Image upright = noise(2);
  for (int y = 1; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x)
      upright.set_rgb(x, y, 0.8f * upright.rgb(x, 0) + 0.2f * upright.rgb(x, y));
  Image turned(kSide, kSide, 3);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) turned.set_rgb(kSide - 1 - y, x, upright.rgb(x, y));
  const auto a = texture_features(texture_planes(upright, covered()), kMiddle);
  const auto b = texture_features(texture_planes(turned, covered()), kMiddle);
  ASSERT_EQ(a.size(), b.size());
  for (size_t f = 0; f < a.size(); ++f) {
    // The last numbers are coherence and direction at two scales.
    const bool is_direction = f + 1 == a.size() || f + 3 == a.size();
    EXPECT_NEAR(a[f], is_direction ? -b[f] : b[f], 2e-3) << "feature " << f;
    if (is_direction) {
      EXPECT_GT(a[f], 0.5f);
    }
  }
}

TEST(Windows, lie_on_the_object) {
  Image coverage(kSide, kSide, 1, 0.0f);
  for (int y = 0; y < kSide; ++y)
    for (int x = 32; x < kSide; ++x) coverage.at(x, y)[0] = 1;
  const TexturePlanes planes = texture_planes(noise(3), coverage);
  const auto windows = windows_on_object(planes, 16, 0.7f);
  EXPECT_FALSE(windows.empty());
  for (const Window& window : windows) EXPECT_GE(window.left, 32);
}

TEST(ColorDifference, of_black_and_white_is_a_hundred) {
  const TexturePlanes black = texture_planes(Image(kSide, kSide, 3, 0.0f), covered());
  const TexturePlanes white = texture_planes(Image(kSide, kSide, 3, 1.0f), covered());
  const auto difference = color_difference(black, white);
  EXPECT_NEAR(mean_over(black, kMiddle, difference), 100, 0.05);
}

}  // namespace
}  // namespace patina::bench
