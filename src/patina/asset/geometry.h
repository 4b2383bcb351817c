// A triangle mesh as it comes out of a file, and what a file may leave out: normals and tangents.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "patina/base/math.h"

namespace patina::asset {

/// Arrays are per vertex and either empty or as long as `position`. Space is the file's own until an instance
/// is made.
struct Geometry {
  std::vector<vec3> position;
  std::vector<vec3> normal;           // unit
  std::vector<vec4> tangent;          // xyz unit, w the bitangent's sign
  std::vector<std::vector<vec2>> uv;  // [set][vertex]
  std::vector<vec4> color;            // linear
  std::vector<uvec3> triangles;       // counter-clockwise seen from the front

  size_t num_vertices() const { return position.size(); }
};

/// The unit vector along `v`; `otherwise` where v has no direction.
vec3 unit_or(const glm::dvec3& v, const vec3& otherwise);

/// A bounding box in double, for assets whose float positions would not tell their vertices apart.
struct Extent {
  glm::dvec3 low{std::numeric_limits<double>::infinity()}, high{-std::numeric_limits<double>::infinity()};
  void add(const glm::dvec3& p) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
};

/// The point that positions are stored relative to: (0, 0, 0), or the box's centre where that lies so many
/// radii away that single precision would coarsen the shape (georeferenced scans).
glm::dvec3 origin_for(const Extent& extent);

/// Vertex `source[i]` of `geometry` as vertex i; triangles are given anew.
Geometry gathered(const Geometry& geometry, const std::vector<uint32_t>& source,
                  std::vector<uvec3> triangles);

/// Whether any triangle has an area on texture coordinates `uv` (one a vertex).
bool has_uv_area(const std::vector<vec2>& uv, const std::vector<uvec3>& triangles);

/// Flat shading: every corner becomes its own vertex with the triangle's normal, tangents are dropped [glTF2,
/// Sec. 3.7.2.1]. Triangles without area get +Z.
Geometry with_flat_normals(const Geometry& geometry);

/// Replaces normals that have no length by the angle-weighted mean of their triangles' normals [Thurmer1998].
void make_smooth_normals(Geometry& geometry);

/// MikkTSpace tangents for the texture coordinates `uv` (one a vertex, origin top left, as the normal map is
/// read). Vertices whose corners get different tangents are split, so the result may have more vertices.
/// Needs normals. See tangents.cpp.
Geometry with_mikktspace_tangents(const Geometry& geometry, const std::vector<vec2>& uv);

}  // namespace patina::asset
