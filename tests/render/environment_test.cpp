#include "patina/render/environment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "../support.h"
#include "patina/base/error.h"
#include "patina/base/random.h"
#include "patina/image/image_io.h"

namespace patina::render {
namespace {

/// A map whose texel (x, y) holds (x, y, 0).
Image coordinates(int width, int height) {
  Image map(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      map.set_rgb(x, y, vec3(static_cast<float>(x), static_cast<float>(y), 0.0f));
  return map;
}

TEST(environment, centre_looks_along_x_right_half_toward_z_top_up) {
  const Environment environment(coordinates(64, 32));
  EXPECT_NEAR(environment.radiance({1, 0, 0}).x, 31.5f, 1e-3f);
  EXPECT_NEAR(environment.radiance({0, 0, 1}).x, 47.5f, 1e-3f);
  EXPECT_NEAR(environment.radiance({0, 0, -1}).x, 15.5f, 1e-3f);
  EXPECT_NEAR(environment.radiance({1, 0, 0}).y, 15.5f, 1e-3f);
  EXPECT_LT(environment.radiance(glm::normalize(vec3(1, 1, 0))).y, 8.5f);
  EXPECT_NEAR(environment.radiance({0, 1, 0}).y, 0.0f, 1e-3f);
  EXPECT_NEAR(environment.radiance({0, -1, 0}).y, 31.0f, 1e-3f);
}

TEST(environment, wraps_in_azimuth) {
  const Environment environment(coordinates(64, 32));
  // Looking along -X the look-up stands between the first and the last column.
  EXPECT_NEAR(environment.radiance(glm::normalize(vec3(-1, 0, 1e-6f))).x, 31.5f, 0.1f);
  EXPECT_NEAR(environment.radiance(glm::normalize(vec3(-1, 0, -1e-6f))).x, 31.5f, 0.1f);
}

TEST(environment, look_up_agrees_with_double_precision) {
  constexpr int kWidth = 64, kHeight = 32;
  const Environment environment(coordinates(kWidth, kHeight));
  RandomStream random(1, RandomPurpose::kTest, 41);
  for (int i = 0; i < 10000; ++i) {
    const double y = 1.0 - 2.0 * random.uniform(),
                 azimuth = 2.0 * std::numbers::pi * (random.uniform() - 0.5);
    const double r = std::sqrt(1.0 - y * y);
    const vec3 direction(glm::dvec3(r * std::cos(azimuth), y, r * std::sin(azimuth)));
    const double column = (0.5 + azimuth / (2.0 * std::numbers::pi)) * kWidth - 0.5;
    const double row = std::acos(y) / std::numbers::pi * kHeight - 0.5;
    const vec3 found = environment.radiance(direction);
    if (column > 0.0 && column < kWidth - 1) {  // elsewhere it runs from the last column to the first
      ASSERT_NEAR(found.x, column, 2e-4) << y << " " << azimuth;
    }
    ASSERT_NEAR(found.y, std::clamp(row, 0.0, kHeight - 1.0), 2e-4) << y << " " << azimuth;
  }
}

TEST(environment, mean_radiance_is_over_the_sphere) {
  EXPECT_NEAR(constant_environment({1, 2, 3}).mean_radiance(), 2.0f, 1e-5f);
  Image half(8, 4, 3);  // light above the horizon only
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 8; ++x) half.set_rgb(x, y, vec3(1.0f));
  EXPECT_NEAR(Environment(half).mean_radiance(), 0.5f, 1e-5f);
}

TEST(environment, refuses_maps_that_are_no_light) {
  EXPECT_THROW(Environment{Image()}, Error);
  EXPECT_THROW(Environment{Image(4, 2, 1)}, Error);
  for (const float bad :
       {-1.0f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    Image map(4, 2, 3, 1.0f);
    map.at(2, 1)[1] = bad;
    EXPECT_THROW(Environment{map}, Error);
  }
}

TEST(environment, studio_is_bright_above_and_of_moderate_range) {
  const Environment studio = studio_environment();
  const Image& map = studio.map();
  EXPECT_EQ(map.width, 512);
  EXPECT_EQ(map.height, 256);
  float low = 1e9f, high = 0.0f;
  for (size_t i = 0; i < map.num_pixels(); ++i) {
    const float value = luminance({map.pixels[3 * i], map.pixels[3 * i + 1], map.pixels[3 * i + 2]});
    low = std::min(low, value), high = std::max(high, value);
  }
  EXPECT_GT(low, 0.05f);  // no direction is black: metals would show it
  EXPECT_LT(high / low, 100.0f);
  EXPECT_GT(luminance(studio.radiance({0, 1, 0})), luminance(studio.radiance({0, -1, 0})));
  EXPECT_GT(studio.mean_radiance(), 0.3f);
  EXPECT_LT(studio.mean_radiance(), 2.0f);
}

TEST(environment, reads_a_real_hdr) {
  PATINA_REQUIRE_SHARED("assets/hdri/adams_place_bridge_1k.hdr");
  const Environment environment =
      read_environment(patina::test::shared_dir() / "assets/hdri/adams_place_bridge_1k.hdr");
  EXPECT_EQ(environment.map().width, 1024);
  EXPECT_GT(environment.mean_radiance(), 0.1f);
}

}  // namespace
}  // namespace patina::render
