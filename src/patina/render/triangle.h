// A triangle of a primitive: its corners in space and what follows from them, and its area on a map.
#pragma once

#include <cmath>

#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"

namespace patina::render {

/// Corners in world space, in metres, counter-clockwise seen from the front.
struct Triangle {
  vec3 a, b, c;
  vec3 cross() const { return glm::cross(b - a, c - a); }  // outward normal times twice the area
  float area() const { return 0.5f * glm::length(cross()); }
  vec3 at(const vec2& barycentric) const { return a + barycentric.x * (b - a) + barycentric.y * (c - a); }
};

inline Triangle triangle_of(const asset::Primitive& primitive, uint32_t triangle) {
  const uvec3& corner = primitive.triangles[triangle];
  return {primitive.p_world[corner.x], primitive.p_world[corner.y], primitive.p_world[corner.z]};
}

/// Area that a triangle covers on `map`, whose whole picture is 1; more where the map repeats on it. The
/// primitive must have the map's UV set.
inline float uv_area(const asset::Primitive& primitive, uint32_t triangle, const asset::Map& map) {
  const uvec3& corner = primitive.triangles[triangle];
  const auto& uv = primitive.uv[static_cast<size_t>(map.uv_set)];
  const vec2 a = asset::map_uv(map, uv[corner.x]), b = asset::map_uv(map, uv[corner.y]) - a,
             c = asset::map_uv(map, uv[corner.z]) - a;
  return 0.5f * std::abs(b.x * c.y - b.y * c.x);
}

}  // namespace patina::render
