// Polygons to triangles.
#pragma once

#include <span>
#include <vector>

#include "patina/base/math.h"

namespace patina::asset {

/// Triangles (indices into `corners`, same winding) of a planar or nearly planar polygon, convex or concave,
/// without holes; n - 2 of them. Polygons that cross themselves, and concave ones of more than 512 corners,
/// are cut as a fan.
std::vector<uvec3> triangulated(std::span<const vec3> corners);

/// Normal times twice the area [Newell's method].
glm::dvec3 polygon_normal(std::span<const vec3> corners);

}  // namespace patina::asset
