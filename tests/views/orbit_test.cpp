// The orbit rig: where cameras stand and what they look at.
#include <algorithm>

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/views/view_set.h"

namespace patina::views {
namespace {

const asset::Bounds kBounds{vec3(-1, 0, 2), vec3(3, 2, 4)};

TEST(Orbit, first_camera_faces_the_asset_from_plus_z) {
  OrbitOptions options;
  options.elevations = {0.0f};
  const auto cameras = orbit_cameras(kBounds, options);
  ASSERT_EQ(cameras.size(), 9u);
  const vec3 toward_eye = glm::normalize(cameras[0].position() - kBounds.center());
  EXPECT_NEAR(toward_eye.z, 1.0f, 1e-6f);
  // The asset's centre lies in the middle of every image.
  for (const auto& camera : cameras) {
    const auto projection = camera.project(kBounds.center());
    ASSERT_TRUE(projection);
    EXPECT_NEAR(projection->pixel.x, 256.0f, 0.01f);
    EXPECT_NEAR(projection->pixel.y, 256.0f, 0.01f);
  }
}

TEST(Orbit, azimuth_steps_are_equal_and_go_once_around) {
  for (const int num_views : {1, 4, 9, 16, 24}) {
    OrbitOptions options;
    options.num_views = num_views;
    options.azimuth_start = 0.3f;
    const auto cameras = orbit_cameras(kBounds, options);
    ASSERT_EQ(cameras.size(), static_cast<size_t>(num_views));
    for (int view = 0; view < num_views; ++view) {
      const vec3 offset = cameras[static_cast<size_t>(view)].position() - kBounds.center();
      const float expected = 0.3f + 2.0f * kPi * static_cast<float>(view) / static_cast<float>(num_views);
      EXPECT_NEAR(std::remainder(std::atan2(offset.x, offset.z) - expected, 2.0f * kPi), 0.0f, 1e-5f);
    }
  }
}

TEST(Orbit, elevations_are_used_in_turn) {
  OrbitOptions options;
  options.elevations = {glm::radians(20.0f), glm::radians(-10.0f)};
  const auto cameras = orbit_cameras(kBounds, options);
  for (size_t view = 0; view < cameras.size(); ++view) {
    const vec3 offset = glm::normalize(cameras[view].position() - kBounds.center());
    EXPECT_NEAR(std::asin(offset.y), options.elevations[view % 2], 1e-5f);
  }
}

TEST(Orbit, bounding_sphere_just_touches_the_image_edges) {
  OrbitOptions options;
  options.elevations = {0.4f};
  const auto camera = orbit_cameras(kBounds, options)[1];
  // The silhouette of a sphere: tangent points as seen from the eye, turned around the viewing axis.
  const vec3 to_eye = camera.position() - kBounds.center();
  const float distance = glm::length(to_eye), radius = kBounds.radius();
  const vec3 axis = to_eye / distance;
  const Basis basis = orthonormal_basis(axis);
  float left = 1e9f, right = -1e9f, top = 1e9f, bottom = -1e9f;
  for (int i = 0; i < 3600; ++i) {
    const float angle = 2.0f * kPi * static_cast<float>(i) / 3600.0f;
    const vec3 side = std::cos(angle) * basis.tangent + std::sin(angle) * basis.bitangent;
    const float sine = radius / distance;
    const vec3 p = kBounds.center() + radius * (sine * axis + std::sqrt(1.0f - sine * sine) * side);
    const auto projection = camera.project(p);
    ASSERT_TRUE(projection);
    left = std::min(left, projection->pixel.x), right = std::max(right, projection->pixel.x);
    top = std::min(top, projection->pixel.y), bottom = std::max(bottom, projection->pixel.y);
  }
  EXPECT_NEAR(left, 0.0f, 0.05f);
  EXPECT_NEAR(top, 0.0f, 0.05f);
  EXPECT_NEAR(right, 512.0f, 0.05f);
  EXPECT_NEAR(bottom, 512.0f, 0.05f);
}

/// A plank of four corners, longer along x than along y and z.
asset::Asset plank() {
  asset::Asset asset;
  asset::Primitive& primitive = asset.primitives.emplace_back();
  primitive.p_world = {vec3(-2, 0, 0), vec3(2, 0, 0.3f), vec3(2, 1, 0), vec3(-2, 1, 0.3f)};
  primitive.triangles = {uvec3(0, 1, 2), uvec3(0, 2, 3)};
  return asset;
}

TEST(Orbit, an_asset_fills_its_views_to_the_margin_and_lies_in_their_middle) {
  const asset::Asset asset = plank();
  for (const float fov_y : {0.2f, 0.6f, 1.2f})
    for (const int num_views : {1, 4, 9, 24}) {
      OrbitOptions options;
      options.num_views = num_views, options.fov_y = fov_y;
      options.elevations = {-0.3f, 0.5f};
      float nearest_edge = 1e9f;
      for (const auto& camera : orbit_cameras(asset, options)) {
        vec2 low(1e9f), high(-1e9f);
        for (const vec3& p : asset.primitives[0].p_world) {
          const auto projection = camera.project(p);
          ASSERT_TRUE(projection);
          low = glm::min(low, projection->pixel), high = glm::max(high, projection->pixel);
        }
        EXPECT_LT(glm::length(low + high - 512.0f), 190.0f * fov_y);  // but for perspective
        nearest_edge = std::min({nearest_edge, low.x, low.y, 512.0f - high.x, 512.0f - high.y});
      }
      EXPECT_NEAR(nearest_edge, 512.0f / 32, 0.05f) << fov_y << " " << num_views;
    }
}

TEST(Orbit, a_spike_toward_the_eye_keeps_its_distance) {
  asset::Asset asset;
  asset::Primitive& primitive = asset.primitives.emplace_back();
  primitive.p_world = {vec3(0, 0, 10), vec3(0.1f, 0, -10), vec3(0, 0.1f, -10)};
  primitive.triangles = {uvec3(0, 1, 2)};
  OrbitOptions options;
  options.num_views = 1, options.elevations = {0.0f};
  const asset::Bounds bounds = asset::bounds(asset);
  const float sphere = glm::length(orbit_cameras(bounds, options)[0].position() - bounds.center());
  EXPECT_NEAR(glm::length(orbit_cameras(asset, options)[0].position() - bounds.center()), 0.5f * sphere,
              1e-3f);
}

TEST(Orbit, given_distance_is_kept) {
  OrbitOptions options;
  options.distance = 7.5f;
  for (const auto& camera : orbit_cameras(kBounds, options))
    EXPECT_NEAR(glm::length(camera.position() - kBounds.center()), 7.5f, 1e-4f);
  const asset::Asset asset = plank();
  for (const auto& camera : orbit_cameras(asset, options))
    EXPECT_NEAR(glm::length(camera.position() - asset::bounds(asset).center()), 7.5f, 1e-4f);
}

TEST(Orbit, rejects_values_out_of_range) {
  const auto rejects = [](auto change) {
    OrbitOptions options;
    change(options);
    try {
      orbit_cameras(kBounds, options);
    } catch (const Error& error) {
      return error.code() == ErrorCode::kUsage;
    }
    return false;
  };
  EXPECT_TRUE(rejects([](OrbitOptions& o) { o.num_views = 0; }));
  EXPECT_TRUE(rejects([](OrbitOptions& o) { o.resolution = 0; }));
  EXPECT_TRUE(rejects([](OrbitOptions& o) { o.elevations.clear(); }));
  EXPECT_TRUE(rejects([](OrbitOptions& o) { o.elevations = {2.0f}; }));
  EXPECT_TRUE(rejects([](OrbitOptions& o) { o.fov_y = kPi; }));
  EXPECT_TRUE(rejects([](OrbitOptions& o) { o.distance = -1.0f; }));
  EXPECT_TRUE(rejects([](OrbitOptions& o) { o.elevations = {std::nanf("")}; }));
}

TEST(Orbit, straight_down_still_makes_a_camera) {
  OrbitOptions options;
  options.elevations = {0.5f * kPi};
  for (const auto& camera : orbit_cameras(kBounds, options)) {
    EXPECT_TRUE(is_finite(camera.position()));
    const auto projection = camera.project(kBounds.center());
    ASSERT_TRUE(projection);
    EXPECT_NEAR(projection->pixel.x, 256.0f, 0.1f);
  }
}

}  // namespace
}  // namespace patina::views
