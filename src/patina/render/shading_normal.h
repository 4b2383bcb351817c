// From a normal map's value to a normal that can be shaded with.
#pragma once

#include "patina/base/math.h"

namespace patina::render {

/// `n_shading` moved just far enough toward `n_geometric` that (1) the viewer stands above it and (2) the
/// mirror direction leaves the surface; returned unchanged wherever both hold already. Without it, normal
/// maps and interpolated normals give black pixels near silhouettes. `wo` points to the viewer; all are unit
/// vectors, dot(n_geometric, wo) >= 0.
vec3 visible_shading_normal(const vec3& n_shading, const vec3& n_geometric, const vec3& wo);

}  // namespace patina::render
