// The orbit rig: cameras at equal steps of azimuth around the asset's bounding sphere [Hadadan2025, Sec. 4].
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "patina/base/error.h"
#include "patina/base/portable_math.h"
#include "patina/views/view_set.h"

namespace patina::views {
namespace {

constexpr float kMargin = 1.0f / 32;  // of a view's side

void require(bool condition, const std::string& message) {
  if (!condition) throw Error(ErrorCode::kUsage, "orbit cameras", message);
}

void check_options(const OrbitOptions& options) {
  require(options.num_views >= 1,
          "number of views must be at least 1, found " + std::to_string(options.num_views));
  require(options.resolution >= 1,
          "resolution must be at least 1 pixel, found " + std::to_string(options.resolution));
  require(!options.elevations.empty(), "at least one elevation must be given");
  for (const float elevation : options.elevations) {
    require(std::abs(elevation) <= 0.5f * kPi, "elevations must lie between -90 and 90 degrees, found " +
                                                   std::to_string(glm::degrees(elevation)));
  }
  require(options.fov_y > 0.0f && options.fov_y < kPi,
          "field of view must lie between 0 and 180 degrees, found " +
              std::to_string(glm::degrees(options.fov_y)));
  require(options.distance >= 0.0f && std::isfinite(options.distance),
          "distance must be positive, or 0 to fit the asset, found " + std::to_string(options.distance));
}

/// Unit direction from the centre to the eye. Azimuth 0 looks at the front of a glTF asset, which faces +Z;
/// it grows toward +X.
vec3 toward_eye(const OrbitOptions& options, int view) {
  const float azimuth =
      options.azimuth_start + 2.0f * kPi * static_cast<float>(view) / static_cast<float>(options.num_views);
  const float elevation = options.elevations[static_cast<size_t>(view) % options.elevations.size()];
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
          std::cos(azimuth) * std::cos(elevation)};
}

// A sphere touches the edges of the image where its tangent through the eye makes half the field of view with
// the axis.
float distance_of_sphere(float radius, float fov_y) {
  return radius / std::sin(0.5f * fov_y);
}

/// Where a view's camera stands: beside the line through the centre, so that the asset lies in the middle.
struct Framing {
  vec3 aside{0};       // from the centre, in the image plane
  float distance = 0;  // at which the vertices reach the margins
};

// A vertex at (x, z), across the image and toward the eye, is in view from a distance d and s aside if
// |x - s| ≤ slope · (d - z). Of all vertices two decide, those of the largest slope · z + x and slope · z -
// x: s lies in the middle of the two, and half of their sum is slope · d.
Framing framing_of(const asset::Asset& asset, const vec3& center, const vec3& axis, float fov_y) {
  const float slope = (1.0f - 2.0f * kMargin) * portable::tan(0.5f * fov_y);
  const mat4 world_from_camera = render::look_at(axis, vec3(0), fov_y, 1, 1).world_from_camera;
  Framing framing;
  for (const vec3& across : {vec3(world_from_camera[0]), vec3(world_from_camera[1])}) {
    float plus = -std::numeric_limits<float>::infinity(), minus = plus;
    for (const asset::Primitive& primitive : asset.primitives)
      for (const uvec3& t : primitive.triangles)
        for (int k = 0; k < 3; ++k) {
          const vec3 p = primitive.p_world[t[k]] - center;
          const float x = glm::dot(p, across), z = slope * glm::dot(p, axis);
          plus = std::max(plus, z + x), minus = std::max(minus, z - x);
        }
    framing.aside += 0.5f * (plus - minus) * across;
    framing.distance = std::max(framing.distance, 0.5f * (plus + minus) / slope);
  }
  return framing;
}

}  // namespace

std::vector<render::Camera> orbit_cameras(const asset::Bounds& bounds, const OrbitOptions& options) {
  check_options(options);
  const vec3 center = bounds.center();
  const float distance =
      options.distance > 0.0f ? options.distance : distance_of_sphere(bounds.radius(), options.fov_y);
  std::vector<render::Camera> cameras;
  cameras.reserve(static_cast<size_t>(options.num_views));
  for (int view = 0; view < options.num_views; ++view) {
    cameras.push_back(render::look_at(center + distance * toward_eye(options, view), center, options.fov_y,
                                      options.resolution, options.resolution));
  }
  return cameras;
}

std::vector<render::Camera> orbit_cameras(const asset::Asset& asset, const OrbitOptions& options) {
  const asset::Bounds bounds = asset::bounds(asset);
  if (options.distance > 0.0f) return orbit_cameras(bounds, options);
  check_options(options);
  // A spike that points at the eye must not touch it.
  float distance = 0.5f * distance_of_sphere(bounds.radius(), options.fov_y);
  std::vector<vec3> targets;
  for (int view = 0; view < options.num_views; ++view) {
    const Framing framing = framing_of(asset, bounds.center(), toward_eye(options, view), options.fov_y);
    targets.push_back(bounds.center() + framing.aside);
    distance = std::max(distance, framing.distance);
  }
  std::vector<render::Camera> cameras;
  for (int view = 0; view < options.num_views; ++view) {
    const vec3& target = targets[static_cast<size_t>(view)];
    cameras.push_back(render::look_at(target + distance * toward_eye(options, view), target, options.fov_y,
                                      options.resolution, options.resolution));
  }
  return cameras;
}

}  // namespace patina::views
