// The GGX microfacet distribution with Smith masking, its visible normals, over a scalar type (float or dual
// number). Directions are unit vectors in the shading frame. Sources: [Walter2007], [Heitz2018], [glTF2, App.
// B.3.2].
#pragma once

#include <algorithm>
#include <cmath>

#include "patina/base/math.h"
#include "patina/render/dual.h"

namespace patina::render {

/// Below this alpha a lobe is narrower than single precision resolves well (a perceptual roughness of 0.032).
inline constexpr float kMinAlpha = 1e-3f;

template <class T>
T alpha_from_roughness(const T& roughness) {
  return at_least(roughness * roughness, kMinAlpha);
}

/// D, 1/sr. `n_h` is the cosine between normal and half vector, `sin2_h` = 1 − n_h², which the caller gets
/// without the cancellation that 1 − n_h² has near the peak of a narrow lobe.
template <class T>
T ggx_distribution(const T& alpha, const T& n_h, const T& sin2_h) {
  const T alpha2 = alpha * alpha;
  const T base = sin2_h + alpha2 * n_h * n_h;
  return alpha2 / (kPi * base * base);
}

/// Smith masking of one direction divided by 2|cos|: the factor of V = G / (4 |N·L| |N·V|) in its separable
/// form [glTF2, App. B.3.2].
template <class T>
T smith_visibility(const T& alpha, const T& cosine) {
  using std::sqrt;
  const T alpha2 = alpha * alpha;
  return 1.0f / (cosine + sqrt(alpha2 + (1.0f - alpha2) * cosine * cosine));
}

/// (1 − x)⁵ for x in [0,1].
template <class T>
T schlick_weight(const T& x) {
  const T m = at_least(1.0f - x, 0.0f);
  const T m2 = m * m;
  return m2 * m2 * m;
}

/// A microfacet normal drawn with density D_wo(h) = G1(wo) max(0, wo·h) D(h) / wo.z [Heitz2018, Sec. 3].
inline vec3 sample_visible_normal(float alpha, const vec3& wo, const vec2& u) {
  const vec3 v = glm::normalize(vec3(alpha * wo.x, alpha * wo.y, wo.z));
  const float length2 = v.x * v.x + v.y * v.y;
  const vec3 t1 = length2 > 0.0f ? vec3(-v.y, v.x, 0.0f) / std::sqrt(length2) : vec3(1, 0, 0);
  const vec3 t2 = glm::cross(v, t1);
  const float r = std::sqrt(u.x);
  const float phi = 2.0f * kPi * u.y;
  const float p1 = r * std::cos(phi);
  const float s = 0.5f * (1.0f + v.z);
  const float p2 = (1.0f - s) * std::sqrt(std::max(0.0f, 1.0f - p1 * p1)) + s * r * std::sin(phi);
  const vec3 n = p1 * t1 + p2 * t2 + std::sqrt(std::max(0.0f, 1.0f - p1 * p1 - p2 * p2)) * v;
  return glm::normalize(vec3(alpha * n.x, alpha * n.y, std::max(1e-7f, n.z)));
}

}  // namespace patina::render
