// The built-in studio environment: three soft boxes over a dome that darkens toward the floor. A material
// needs a large soft source to read its colour, a smaller bright one to read its roughness, and a rim to read
// its silhouette; the range is moderate (about 40 : 1), so that few samples render it cleanly.
#include "patina/render/environment.h"

namespace patina::render {
namespace {

/// A rectangular soft box that faces the origin: radiance falls off smoothly over `edge` at its border.
struct SoftBox {
  float azimuth, elevation;  // of its centre, degrees; azimuth 0 is +Z (where the viewer stands), 90 is +X
  float half_width, half_height, edge;  // tangents of angles
  vec3 radiance;
};

vec3 direction_of(float azimuth_degrees, float elevation_degrees) {
  const float a = glm::radians(azimuth_degrees), e = glm::radians(elevation_degrees);
  return {std::cos(e) * std::sin(a), std::sin(e), std::cos(e) * std::cos(a)};
}

vec3 light_of(const SoftBox& box, const vec3& direction) {
  const vec3 center = direction_of(box.azimuth, box.elevation);
  const vec3 right = glm::normalize(glm::cross(vec3(0, 1, 0), center));
  const vec3 up = glm::cross(center, right);
  const float depth = glm::dot(direction, center);
  if (depth <= 0.05f) return vec3(0.0f);
  const float x = std::abs(glm::dot(direction, right)) / depth, y = std::abs(glm::dot(direction, up)) / depth;
  return box.radiance * (1.0f - glm::smoothstep(box.half_width - box.edge, box.half_width + box.edge, x)) *
         (1.0f - glm::smoothstep(box.half_height - box.edge, box.half_height + box.edge, y));
}

}  // namespace

Environment studio_environment() {
  const SoftBox boxes[] = {
      {40.0f, 42.0f, 0.55f, 0.42f, 0.06f, 11.0f * vec3(1.0f, 0.96f, 0.90f)},  // key: front right, above, warm
      {-60.0f, 18.0f, 0.75f, 0.60f, 0.15f, 2.6f * vec3(0.90f, 0.95f, 1.0f)},  // fill: front left, large, cool
      {160.0f, 30.0f, 0.28f, 0.75f, 0.05f, 9.0f * vec3(0.97f, 0.98f, 1.0f)},  // rim: behind right, tall
      {-140.0f, 35.0f, 0.22f, 0.60f, 0.05f, 6.0f * vec3(1.0f, 0.97f, 0.93f)},  // second rim: behind left
  };
  return environment_of([&](const vec3& direction) {
    const float height = 0.5f + 0.5f * direction.y;
    vec3 light =
        glm::mix(vec3(0.22f, 0.21f, 0.20f), vec3(0.62f, 0.64f, 0.67f), glm::smoothstep(0.15f, 0.95f, height));
    for (const SoftBox& box : boxes) light += light_of(box, direction);
    return light;
  });
}

}  // namespace patina::render
