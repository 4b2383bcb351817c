// Triangle meshes under construction, and what ageing needs to know of a finished one: curvature at two
// scales and where water would run.
#pragma once

#include <functional>
#include <vector>

#include "patina/asset/asset.h"
#include "patina/base/math.h"

namespace patina::make_dataset {

/// Triangles counter-clockwise from outside; vertices may be shared or doubled, `finished` sorts that out.
struct Mesh {
  std::vector<vec3> positions;
  std::vector<uvec3> triangles;
};

void append(Mesh& mesh, const Mesh& part, const mat4& placed = mat4(1.0f));

/// A grid of (steps_u + 1) × (steps_v + 1) points p(u, v), u and v in [0,1]; normals are ∂p/∂u × ∂p/∂v.
Mesh grid(int steps_u, int steps_v, const std::function<vec3(float, float)>& p);

/// A mesh ready to be baked. Vertices are doubled along creases, so that normals are smooth between them.
struct Finished {
  asset::Asset asset;  // one primitive, one white material; the unit sphere holds it
  std::vector<float> curvature_fine, curvature_coarse, flow;  // per vertex, [0,1] as ViewPlane says
};

/// Welds equal positions, drops triangles without area, moves and scales into the unit sphere, splits long
/// edges, then computes normals (smooth up to `crease` radians), curvatures and flow.
Finished finished(const Mesh& mesh, float crease = 0.7f);

}  // namespace patina::make_dataset
