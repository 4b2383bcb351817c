// The loss: its residuals, their derivatives, and which pixels count how much.
#include "patina/inverse/loss.h"

#include <cmath>

#include <gtest/gtest.h>

namespace patina::test {
namespace {

TEST(loss, derivative_agrees_with_central_differences) {
  for (const float radiance : {0.001f, 0.05f, 0.6f, 4.0f, 50.0f})
    for (const float target : {0.0f, 0.3f, 0.95f}) {
      const vec3 at(radiance, 0.5f * radiance, 2.0f * radiance), goal(target, 0.2f, 0.8f);
      const float gain = 1.7f;
      const inverse::PixelResidual residual = inverse::relative_residual(at, goal, gain);
      for (int c = 0; c < 3; ++c) {
        // The definition in double, its denominator held at the present value.
        const auto value = [&](double x) {
          const double mapped = gain * x / (1 + gain * x),
                       now = std::max(gain * at[c] / (1.0 + gain * at[c]), double{goal[c]});
          return (mapped - goal[c]) / std::sqrt(3 * (now * now + inverse::kLossEpsilon));
        };
        EXPECT_NEAR(residual.value[c], value(at[c]), 1e-5);
        const double h = 1e-4 * at[c];
        const double numeric = (value(at[c] + h) - value(at[c] - h)) / (2 * h);
        EXPECT_NEAR(residual.d_radiance[c], numeric, 1e-3 * std::abs(numeric) + 1e-5);
      }
    }
}

TEST(loss, a_clipped_target_asks_for_that_much_light_or_more) {
  const vec3 white(1.0f);
  const inverse::PixelResidual darker = inverse::relative_residual(vec3(2.0f), white, 1.0f),
                               brighter = inverse::relative_residual(vec3(100.0f), vec3(0.97f), 1.0f);
  EXPECT_LT(darker.value.x, 0.0f);
  EXPECT_GT(darker.d_radiance.x, 0.0f);
  EXPECT_EQ(brighter.value, vec3(0.0f));
  EXPECT_EQ(brighter.d_radiance, vec3(0.0f));
}

TEST(loss, weight_is_zero_near_silhouettes_and_falls_at_grazing_angles) {
  views::GBuffer g;
  g.width = g.height = 20;
  g.material.assign(400, -1);
  g.view_cosine.assign(400, 1.0f);
  g.depth.assign(400, 5.0f);
  g.p_world.resize(400);
  g.n_geometric_world.assign(400, vec3(0, 0, 1));
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) {
      const auto i = static_cast<size_t>(20 * y + x);
      g.p_world[i] = {0.1f * static_cast<float>(x), 0.1f * static_cast<float>(y), -5.0f};
      if (x >= 4) g.material[i] = 0;
      if (x >= 17) g.view_cosine[i] = 0.25f;
      if (y >= 10 && x >= 4) g.depth[i] = 9.0f, g.p_world[i].z = -9.0f;  // a step in depth
    }
  const Image weight = inverse::loss_weight(g, {true}, 3);
  EXPECT_EQ(*weight.at(3, 4), 0.0f);
  EXPECT_EQ(*weight.at(6, 4), 0.0f);  // three pixels from the last one outside
  EXPECT_EQ(*weight.at(7, 4), 1.0f);
  EXPECT_EQ(*weight.at(10, 9), 0.0f);
  EXPECT_EQ(*weight.at(10, 7), 0.0f);
  EXPECT_EQ(*weight.at(10, 6), 1.0f);
  EXPECT_EQ(*weight.at(10, 12), 0.0f);
  EXPECT_EQ(*weight.at(10, 13), 1.0f);
  EXPECT_FLOAT_EQ(*weight.at(18, 4), 0.5f);
  const Image other = inverse::loss_weight(g, {false}, 3);
  for (const float w : other.pixels) EXPECT_EQ(w, 0.0f);
}

}  // namespace
}  // namespace patina::test
