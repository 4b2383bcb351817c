#include "patina/render/camera.h"

#include <gtest/gtest.h>

#include "patina/base/random.h"

namespace patina::render {
namespace {

TEST(camera, centre_ray_looks_at_the_target) {
  const Camera camera = look_at({1, 2, 3}, {4, 0, -2}, 0.6f, 101, 51);
  const Ray ray = camera.ray({50.5f, 25.5f});
  EXPECT_EQ(ray.origin, vec3(1, 2, 3));
  EXPECT_NEAR(glm::dot(ray.direction, glm::normalize(vec3(3, -2, -5))), 1.0f, 1e-6f);
}

TEST(camera, image_goes_right_and_down_from_the_top_left) {
  const Camera camera = look_at({0, 0, 5}, {0, 0, 0}, 0.8f, 200, 100);
  EXPECT_LT(camera.ray({0, 50}).direction.x, 0.0f);
  EXPECT_GT(camera.ray({200, 50}).direction.x, 0.0f);
  EXPECT_GT(camera.ray({100, 0}).direction.y, 0.0f);
  EXPECT_LT(camera.ray({100, 100}).direction.y, 0.0f);
  // The vertical field of view spans the image's height exactly.
  EXPECT_NEAR(std::acos(glm::dot(camera.ray({100, 0}).direction, camera.ray({100, 100}).direction)), 0.8f,
              1e-5f);
}

TEST(camera, project_inverts_ray) {
  RandomStream random(41, RandomPurpose::kTest, 0);
  for (int i = 0; i < 200; ++i) {
    const vec3 eye(random.gaussian(), random.gaussian(), random.gaussian());
    const Camera camera =
        look_at(eye, eye + vec3(random.gaussian(), random.gaussian(), random.gaussian()), 0.9f, 320, 240);
    const vec2 pixel(320.0f * random.uniform(), 240.0f * random.uniform());
    const Ray ray = camera.ray(pixel);
    const float t = 0.5f + 10.0f * random.uniform();
    const auto projection = camera.project(ray.origin + t * ray.direction);
    ASSERT_TRUE(projection.has_value());
    EXPECT_NEAR(projection->pixel.x, pixel.x, 2e-3f);
    EXPECT_NEAR(projection->pixel.y, pixel.y, 2e-3f);
    const vec3 forward = -vec3(camera.world_from_camera[2]);
    EXPECT_NEAR(projection->depth, t * glm::dot(ray.direction, forward), 1e-4f * t);
  }
}

TEST(camera, nothing_behind_the_eye_is_projected) {
  const Camera camera = look_at({0, 0, 5}, {0, 0, 0}, 0.8f, 10, 10);
  EXPECT_FALSE(camera.project({0, 0, 6}).has_value());
  EXPECT_FALSE(camera.project({0, 0, 5}).has_value());
  EXPECT_TRUE(camera.project({0, 0, 4}).has_value());
}

TEST(camera, looks_straight_up_and_down) {
  for (const float y : {-1.0f, 1.0f}) {
    const Camera camera = look_at({0, 0, 0}, {0, y, 0}, 0.8f, 10, 10);
    const mat3 rotation(camera.world_from_camera);
    EXPECT_NEAR(glm::determinant(rotation), 1.0f, 1e-6f);
    EXPECT_NEAR(camera.ray({5, 5}).direction.y, y, 1e-6f);
  }
}

TEST(camera, refuses_a_camera_without_direction_or_size) {
  EXPECT_THROW(look_at({1, 1, 1}, {1, 1, 1}, 0.5f, 8, 8), std::logic_error);
  EXPECT_THROW(look_at({1, 1, 1}, {0, 0, 0}, 0.5f, 0, 8), std::logic_error);
  EXPECT_THROW(look_at({1, 1, 1}, {0, 0, 0}, 4.0f, 8, 8), std::logic_error);
}

}  // namespace
}  // namespace patina::render
