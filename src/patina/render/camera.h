// A pinhole camera. Right-handed, looks along -Z of its own frame, +Y up; pixels from the top left, centres
// at +0.5.
#pragma once

#include <limits>
#include <optional>

#include "patina/base/math.h"

namespace patina::render {

struct Ray {
  vec3 origin;
  vec3 direction;  // unit
  float t_min = 0.0f;
  float t_max = std::numeric_limits<float>::infinity();
};

struct Camera {
  mat4 world_from_camera{1.0f};  // rigid: rotation and translation only
  float fov_y = 0.6f;            // full vertical angle, radians
  int width = 0, height = 0;     // pixels

  vec3 position() const { return vec3(world_from_camera[3]); }
  /// Distance from the eye to the image plane, in pixels.
  float focal_pixels() const { return 0.5f * static_cast<float>(height) / std::tan(0.5f * fov_y); }
  /// The ray through continuous pixel coordinates.
  Ray ray(const vec2& pixel) const;
  /// Continuous pixel coordinates of a world point and its depth along the viewing axis (metres); nullopt
  /// behind the eye.
  struct Projection {
    vec2 pixel;
    float depth;
  };
  std::optional<Projection> project(const vec3& p_world) const;
};

/// The rays of one camera, which must outlive it; the tangent of the field of view is taken once for all of
/// them.
class CameraRays {
 public:
  explicit CameraRays(const Camera& camera) : camera_(camera), focal_(camera.focal_pixels()) {}
  Ray operator()(const vec2& pixel) const;

 private:
  const Camera& camera_;
  float focal_;
};

/// A camera at `eye` that looks at `target`, its image's vertical as near to +Y as can be.
Camera look_at(const vec3& eye, const vec3& target, float fov_y, int width, int height);

}  // namespace patina::render
