#include "patina/render/camera.h"

#include "patina/base/check.h"

namespace patina::render {

Ray CameraRays::operator()(const vec2& pixel) const {
  const vec3 direction_camera((pixel.x - 0.5f * static_cast<float>(camera_.width)) / focal_,
                              (0.5f * static_cast<float>(camera_.height) - pixel.y) / focal_, -1.0f);
  Ray out;
  out.origin = camera_.position();
  out.direction = glm::normalize(mat3(camera_.world_from_camera) * direction_camera);
  return out;
}

Ray Camera::ray(const vec2& pixel) const {
  return CameraRays(*this)(pixel);
}

std::optional<Camera::Projection> Camera::project(const vec3& p_world) const {
  // The inverse of a rotation is its transpose: v * M is transpose(M) * v.
  const vec3 p_camera = (p_world - position()) * mat3(world_from_camera);
  const float depth = -p_camera.z;
  if (!(depth > 0.0f)) return std::nullopt;
  const float scale = focal_pixels() / depth;
  return Projection{vec2(0.5f * static_cast<float>(width) + scale * p_camera.x,
                         0.5f * static_cast<float>(height) - scale * p_camera.y),
                    depth};
}

Camera look_at(const vec3& eye, const vec3& target, float fov_y, int width, int height) {
  const vec3 to_target = target - eye;
  PATINA_CHECK_LT(0.0f, glm::length(to_target));
  PATINA_CHECK(fov_y > 0.0f && fov_y < kPi);
  PATINA_CHECK(width > 0 && height > 0);
  const vec3 backward = -glm::normalize(to_target);
  // Straight up or down, +Y has no image: the top of the image is then -Z, as a map on a table.
  vec3 right = glm::cross(vec3(0, 1, 0), backward);
  if (glm::length(right) < 1e-6f) right = vec3(1, 0, 0);
  right = glm::normalize(right);
  const vec3 up = glm::cross(backward, right);
  Camera camera;
  camera.world_from_camera = mat4(vec4(right, 0), vec4(up, 0), vec4(backward, 0), vec4(eye, 1));
  camera.fov_y = fov_y;
  camera.width = width;
  camera.height = height;
  return camera;
}

}  // namespace patina::render
