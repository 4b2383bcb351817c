// The local frame of a shading point, in which BSDFs are written.
#pragma once

#include "patina/base/math.h"

namespace patina::render {

/// A right-handed orthonormal frame whose z axis is the unit normal `n`.
struct Frame {
  explicit Frame(const vec3& n) : basis(orthonormal_basis(n)), normal(n) {}
  vec3 to_local(const vec3& v) const {
    return {glm::dot(v, basis.tangent), glm::dot(v, basis.bitangent), glm::dot(v, normal)};
  }
  vec3 to_world(const vec3& v) const { return v.x * basis.tangent + v.y * basis.bitangent + v.z * normal; }

  Basis basis;
  vec3 normal;
};

}  // namespace patina::render
