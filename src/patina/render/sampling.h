// Small samplers and the weights that combine them.
#pragma once

#include <algorithm>
#include <cmath>

#include "patina/base/math.h"

namespace patina::render {

/// A direction about +Z with density cos θ / π.
inline vec3 sample_cosine_hemisphere(const vec2& u) {
  const float r = std::sqrt(u.x);
  const float phi = 2.0f * kPi * u.y;
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0f, 1.0f - u.x))};
}

/// Weights of a triangle's second and third vertex for a point uniform over its area [Turk1990].
inline vec2 sample_triangle(const vec2& u) {
  const float root = std::sqrt(u.x);
  return {root * (1.0f - u.y), root * u.y};
}

/// Share of a sample with density `pdf` where `other` could have made it too: the balance heuristic
/// [Veach1997, Eq. 9.8].
inline float balance_heuristic(float pdf, float other) {
  return pdf > 0.0f ? pdf / (pdf + other) : 0.0f;
}

}  // namespace patina::render
