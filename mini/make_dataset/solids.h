// Building blocks of shapes: solids and surfaces as meshes, +Y up.
#pragma once

#include <utility>
#include <vector>

#include "mesh.h"

namespace patina::make_dataset {

/// A box of half sizes `half` whose edges are rounded by `radius`.
Mesh rounded_box(const vec3& half, float radius);
/// |x|^(2/e) + … = 1 along each half axis: e = 1 ellipsoid, 0.3 nearly a box, 2 an octahedron.
Mesh superellipsoid(const vec3& half, float e_vertical, float e_horizontal);
/// A profile (radius, height) turned about +Y, from the lower end of the axis to the upper for an outside
/// that looks outward; `flutes` > 0 carves that many grooves of depth `flute_depth` (share of the radius).
Mesh lathe(const std::vector<vec2>& profile, int flutes = 0, float flute_depth = 0);
/// A tube around a chain of points; `radii` at each, ends closed.
Mesh tube(const std::vector<vec3>& path, const std::vector<float>& radii, bool closed = false);
/// A polygon (counter-clockwise, star-shaped about the origin) in XY pulled along Z by ± half_depth, edges
/// cut by `bevel`.
Mesh prism(const std::vector<vec2>& polygon, float half_depth, float bevel);
/// A sphere of radius one, `rounds` subdivisions of an icosahedron.
Mesh icosphere(int rounds);

/// A straight cylinder from the origin upward, its edges cut by `bevel`.
Mesh cylinder(float radius, float height, float bevel);
/// A ring in XY, or the first `arc` of it from +X toward +Y.
Mesh torus_mesh(float large, float small, float arc = 1.0f);
/// A tube along a smooth curve through the points, whose radius goes from one value to the other.
Mesh bent_tube(const std::vector<vec3>& points, float from, float to);

using Profile = std::vector<vec2>;
Profile joined(Profile a, const Profile& b);
/// A vessel's wall with an inside: `outer` goes up, then the inner side comes down `wall` further in.
Profile vessel(const Profile& outer, float wall);

/// A smooth curve through the points (Catmull-Rom), `steps` pieces between two.
std::vector<vec2> smooth_curve(const std::vector<vec2>& points, int steps = 10);
std::vector<vec3> smooth_curve(const std::vector<vec3>& points, int steps = 10);

mat4 placed(const vec3& offset, float degrees = 0, const vec3& axis = vec3(0, 1, 0),
            const vec3& scale = vec3(1));

}  // namespace patina::make_dataset
