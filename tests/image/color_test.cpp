// Colour: the sRGB curve and tone mapping.
#include "patina/image/color.h"
#include "patina/image/lab.h"

#include <gtest/gtest.h>

namespace patina {
namespace {

TEST(Srgb, known_values_and_round_trip) {
  EXPECT_FLOAT_EQ(srgb_from_linear(0.0f), 0.0f);
  EXPECT_NEAR(srgb_from_linear(1.0f), 1.0f, 1e-6f);
  EXPECT_NEAR(linear_from_srgb(0.5f), 0.214041f, 1e-5f);
  EXPECT_NEAR(srgb_from_linear(0.18f), 0.461356f, 1e-5f);
  for (int i = -300; i <= 300; ++i) {
    const float v = static_cast<float>(i) / 200.0f;
    EXPECT_NEAR(srgb_from_linear(linear_from_srgb(v)), v, 2e-6f);
  }
}

TEST(Srgb, is_continuous_and_monotonous_at_the_seam) {
  EXPECT_NEAR(linear_from_srgb(0.04045f), linear_from_srgb(0.0404501f), 1e-6f);
  for (float v = 0.0f; v < 0.01f; v += 1e-5f) EXPECT_LT(srgb_from_linear(v), srgb_from_linear(v + 1e-5f));
}

TEST(Reinhard, derivative_agrees_with_central_differences) {
  for (const float v : {0.0f, 0.01f, 0.5f, 1.0f, 20.0f}) {
    const double h = 1e-3 * (1.0 + static_cast<double>(v));
    const auto exact = [](double x) { return x / (1.0 + x); };
    EXPECT_NEAR(d_reinhard(v), (exact(v + h) - exact(v - h)) / (2 * h), 1e-5);
  }
}

TEST(ToneMap, exposure_doubles_radiance) {
  Image image(2, 1, 3, 0.5f);
  const Image mapped = tone_map(image, 1.0f);
  for (const float v : mapped.pixels) EXPECT_NEAR(v, srgb_from_linear(0.5f), 1e-6f);
}

// Values of the sRGB primaries as published with the standard's matrices.
TEST(Lab, of_white_grey_and_the_primaries) {
  const auto expect_lab = [](const vec3& rgb, const vec3& lab) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(lab_from_linear(rgb)[i], lab[i], 0.1f) << i;
  };
  expect_lab({1, 1, 1}, {100, 0, 0});
  expect_lab({0, 0, 0}, {0, 0, 0});
  expect_lab(vec3(0.18418652f), {50, 0, 0});
  expect_lab({1, 0, 0}, {53.24f, 80.09f, 67.20f});
  expect_lab({0, 1, 0}, {87.73f, -86.18f, 83.18f});
  expect_lab({0, 0, 1}, {32.30f, 79.19f, -107.86f});
}

}  // namespace
}  // namespace patina
