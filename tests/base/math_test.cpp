#include "patina/base/math.h"

#include <gtest/gtest.h>

#include "patina/base/portable_math.h"
#include "patina/base/random.h"

namespace patina {
namespace {

TEST(OrthonormalBasis, is_orthonormal_and_right_handed_for_every_direction) {
  std::vector<vec3> directions{{0, 0, 1},
                               {0, 0, -1},
                               {1, 0, 0},
                               {0, -1, 0},
                               glm::normalize(vec3(1e-4f, 0, -1)),
                               {0, 0, -1.0f + 6e-8f}};
  RandomStream random(1, RandomPurpose::kTest, 0);
  for (int i = 0; i < 2000; ++i)
    directions.push_back(glm::normalize(vec3(random.gaussian(), random.gaussian(), random.gaussian())));
  for (const vec3& n : directions) {
    const auto [t, b] = orthonormal_basis(n);
    EXPECT_NEAR(glm::length(t), 1, 1e-5f);
    EXPECT_NEAR(glm::length(b), 1, 1e-5f);
    EXPECT_NEAR(glm::dot(t, n), 0, 1e-5f);
    EXPECT_NEAR(glm::dot(b, n), 0, 1e-5f);
    EXPECT_NEAR(glm::length(glm::cross(t, b) - n), 0, 2e-5f) << n.x << ' ' << n.y << ' ' << n.z;
  }
}

TEST(PortableMath, rounds_to_the_nearest_float) {
  RandomStream random(1, RandomPurpose::kTest, 1);
  for (int i = 0; i < 100000; ++i) {
    const float x = random.gaussian(), y = random.gaussian();
    const auto x_long = static_cast<long double>(x), y_long = static_cast<long double>(y);
    ASSERT_EQ(portable::cbrt(x), static_cast<float>(std::cbrt(x_long))) << x;
    ASSERT_EQ(portable::atan2(y, x), static_cast<float>(std::atan2(y_long, x_long))) << y << ' ' << x;
    ASSERT_EQ(portable::tan(x), static_cast<float>(std::tan(x_long))) << x;
  }
}

TEST(Luminance, of_white_is_one_and_green_weighs_most) {
  EXPECT_NEAR(luminance(vec3(1.0f)), 1, 1e-6f);
  EXPECT_GT(luminance({0, 1, 0}), luminance({1, 0, 0}));
  EXPECT_GT(luminance({1, 0, 0}), luminance({0, 0, 1}));
}

TEST(IsFinite, sees_every_component) {
  EXPECT_TRUE(is_finite({0, -1, 1e38f}));
  for (int i = 0; i < 3; ++i)
    for (const float bad :
         {std::nanf(""), std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()}) {
      vec3 v(0.0f);
      v[i] = bad;
      EXPECT_FALSE(is_finite(v));
    }
}

TEST(MaxComponent, finds_it_in_any_place) {
  EXPECT_EQ(max_component({3, 1, 2}), 3);
  EXPECT_EQ(max_component({1, 3, 2}), 3);
  EXPECT_EQ(max_component({-1, -2, -0.5f}), -0.5f);
}

}  // namespace
}  // namespace patina
