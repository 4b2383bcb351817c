#include "patina/render/shading_normal.h"

namespace patina::render {

vec3 visible_shading_normal(const vec3& n_shading, const vec3& n_geometric, const vec3& wo) {
  const float cos_o = glm::dot(n_geometric, wo);
  // At grazing views even the geometric normal reflects along the surface: ask for no more than it can give.
  const float min_view = std::min(0.9f * cos_o, 0.02f), min_reflection = std::min(0.9f * cos_o, 0.01f);
  const auto is_visible = [&](const vec3& n) {
    const float n_o = glm::dot(n, wo);
    return n_o >= min_view && 2.0f * n_o * glm::dot(n, n_geometric) - cos_o >= min_reflection;
  };
  if (is_visible(n_shading)) return n_shading;

  // Bisect on the way to the geometric normal, which always satisfies both.
  float low = 0.0f, high = 1.0f;
  for (int i = 0; i < 10; ++i) {
    const float middle = 0.5f * (low + high);
    const vec3 n = glm::mix(n_shading, n_geometric, middle);
    const float length = glm::length(n);
    if (length > 1e-4f && is_visible(n / length))
      high = middle;
    else
      low = middle;
  }
  const vec3 n = glm::mix(n_shading, n_geometric, high);
  const float length = glm::length(n);
  return length > 1e-4f ? n / length : n_geometric;
}

}  // namespace patina::render
