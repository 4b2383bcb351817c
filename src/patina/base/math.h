// The vector types of patina (GLM's) and the few small functions that GLM lacks.
#pragma once

#include <cmath>
#include <numbers>

#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

namespace patina {

using glm::ivec2;
using glm::ivec3;
using glm::mat3;
using glm::mat4;
using glm::uvec3;
using glm::vec2;
using glm::vec3;
using glm::vec4;

inline constexpr float kPi = std::numbers::pi_v<float>;
inline constexpr float kInvPi = std::numbers::inv_pi_v<float>;

inline float square(float x) {
  return x * x;
}
inline float max_component(const vec3& v) {
  return std::max(v.x, std::max(v.y, v.z));
}
inline bool is_finite(const vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Rec. 709 luminance of linear RGB [Y of CIE XYZ].
inline float luminance(const vec3& rgb) {
  return 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;
}

/// Two unit vectors that form a right-handed orthonormal basis (tangent, bitangent, n) with the unit vector
/// n. Source: [Duff2017], without a branch and exact at n.z = -1.
struct Basis {
  vec3 tangent, bitangent;
};
inline Basis orthonormal_basis(const vec3& n) {
  const float sign = std::copysign(1.0f, n.z);
  const float a = -1.0f / (sign + n.z);
  const float b = n.x * n.y * a;
  return {vec3(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x), vec3(b, sign + n.y * n.y * a, -n.y)};
}

}  // namespace patina
