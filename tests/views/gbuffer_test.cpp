// G-buffers against surfaces whose values are known by formula.
#include <numeric>

#include <gtest/gtest.h>

#include "../render/scenes.h"
#include "patina/views/view_set.h"

namespace patina::views {
namespace {

namespace scenes = render::test;

struct World {
  std::vector<scenes::Part> parts, context_parts;
  asset::Asset asset, context;
  render::Scene scene;
  explicit World(std::vector<scenes::Part> parts_, std::vector<scenes::Part> context_parts_ = {})
      : parts(std::move(parts_)),
        context_parts(std::move(context_parts_)),
        asset(scenes::make_asset(parts)),
        context(scenes::make_asset(context_parts)),
        scene(asset, scenes::make_maps(parts), render::constant_environment(vec3(1.0f)),
              context_parts.empty() ? nullptr : &context, {}) {}
};

double sum(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

TEST(GBuffer, plane_has_the_depth_position_and_cosine_of_its_formula) {
  // A plane through the origin, tilted by 30° about X.
  const float tilt = glm::radians(30.0f);
  const vec3 along(1, 0, 0), up(0, std::cos(tilt), -std::sin(tilt));
  const World world({{scenes::quad(-10.0f * along - 10.0f * up, 20.0f * along, 20.0f * up), {}}});
  const vec3 normal = glm::cross(along, up);
  const render::Camera camera = render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 33, 21);
  const GBuffer gbuffer = make_gbuffer(world.scene, camera);
  ASSERT_EQ(gbuffer.width, 33);
  ASSERT_EQ(gbuffer.height, 21);
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 33; ++x) {
      const auto i = static_cast<size_t>(y * 33 + x);
      const render::Ray ray = camera.ray(vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
      const float t = -glm::dot(ray.origin, normal) / glm::dot(ray.direction, normal);
      const vec3 expected = ray.origin + t * ray.direction;
      ASSERT_EQ(gbuffer.primitive[i], 0);
      EXPECT_EQ(gbuffer.material[i], 0);
      EXPECT_LT(glm::length(gbuffer.p_world[i] - expected), 1e-5f);
      EXPECT_NEAR(gbuffer.depth[i], 5.0f - expected.z, 1e-5f);
      EXPECT_NEAR(gbuffer.view_cosine[i], -glm::dot(normal, ray.direction), 1e-5f);
      EXPECT_LT(glm::length(gbuffer.n_geometric_world[i] - normal), 1e-5f);
      EXPECT_EQ(gbuffer.coverage[i], 1.0f);
    }
  }
}

TEST(GBuffer, empty_scene_around_the_object_has_no_hit_and_infinite_depth) {
  const World world({{scenes::sphere(vec3(0.0f), 1.0f, 32), {}}});
  const GBuffer gbuffer = make_gbuffer(world.scene, render::look_at(vec3(0, 0, 6), vec3(0.0f), 0.6f, 32, 32));
  EXPECT_EQ(gbuffer.primitive[0], -1);
  EXPECT_EQ(gbuffer.triangle[0], -1);
  EXPECT_EQ(gbuffer.material[0], -1);
  EXPECT_TRUE(std::isinf(gbuffer.depth[0]));
  EXPECT_EQ(gbuffer.coverage[0], 0.0f);
}

TEST(GBuffer, coverage_sums_to_the_projected_area) {
  const World world({{scenes::sphere(vec3(0.0f), 1.0f, 128), {}}});
  const render::Camera camera = render::look_at(vec3(0, 0, 6), vec3(0.0f), 0.6f, 64, 64);
  const GBuffer gbuffer = make_gbuffer(world.scene, camera);
  // A sphere on the axis projects to a disc of radius f · tan(asin(r/d)).
  const double radius = static_cast<double>(camera.focal_pixels()) * std::tan(std::asin(1.0 / 6.0));
  const double area = static_cast<double>(kPi) * radius * radius;
  EXPECT_NEAR(sum(gbuffer.coverage) / area, 1.0, 0.005);
  // Some pixels lie on the edge, and their shares are sixteenths.
  int partial = 0;
  for (const float coverage : gbuffer.coverage) {
    partial += coverage > 0.0f && coverage < 1.0f;
    EXPECT_EQ(coverage * 16.0f, std::round(coverage * 16.0f));
  }
  EXPECT_GT(partial, 50);
}

TEST(GBuffer, half_covered_pixels_are_one_half) {
  const World world({{scenes::quad(vec3(-10, -10, 0), vec3(10, 0, 0), vec3(0, 20, 0)), {}}});
  // The plane ends at x = 0, in the middle of the middle column of an odd width.
  const GBuffer gbuffer = make_gbuffer(world.scene, render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 15, 15));
  for (size_t y = 0; y < 15; ++y) {
    EXPECT_EQ(gbuffer.coverage[y * 15 + 6], 1.0f);
    EXPECT_EQ(gbuffer.coverage[y * 15 + 7], 0.5f);
    EXPECT_EQ(gbuffer.coverage[y * 15 + 8], 0.0f);
  }
}

TEST(GBuffer, context_is_hit_but_not_covered_and_hides_the_asset) {
  const World world({{scenes::quad(vec3(-1, -1, 0), vec3(2, 0, 0), vec3(0, 2, 0)), {}}},
                    {{scenes::quad(vec3(-10, -10, 1), vec3(10, 0, 0), vec3(0, 20, 0)), {}}});
  const GBuffer gbuffer = make_gbuffer(world.scene, render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.3f, 16, 16));
  EXPECT_EQ(gbuffer.primitive[8 * 16 + 2], 1);
  EXPECT_EQ(gbuffer.coverage[8 * 16 + 2], 0.0f);
  EXPECT_EQ(gbuffer.primitive[8 * 16 + 11], 0);
  EXPECT_EQ(gbuffer.coverage[8 * 16 + 11], 1.0f);
}

}  // namespace
}  // namespace patina::views
