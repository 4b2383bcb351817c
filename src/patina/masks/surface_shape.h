// The shape of a surface around a point, by casting rays: what closes it in, and whether it bends away.
#pragma once

#include "patina/render/scene.h"

namespace patina::masks {

/// How a point's rays are drawn: the same (seed, index) gives the same.
struct ShapeRays {
  int count = 32;
  uint64_t seed = 0, index = 0;
};

/// Share of the sky over a point, weighted by the cosine to its geometric normal, that a surface nearer than
/// `range` metres hides: 0 on a plane, 1/2 in the corner of two walls, 1 in a hole.
float closed_in(const render::Scene& scene, const render::SurfacePoint& point, float range,
                const ShapeRays& rays);

/// Twice the share of rays into the body, weighted alike, that leave it again within `range` metres through
/// its own surface (context does not count): 0 on a plane, 1 on the edge of a cube. What is left through
/// counts by how it is turned, from full (up to a right angle) to nothing (the back of a sheet), so that thin
/// walls are no edges.
float bends_away(const render::Scene& scene, const render::SurfacePoint& point, float range,
                 const ShapeRays& rays);

/// How the normal map bends the surface over `distance` metres to each side, as the sum of the changes of its
/// tilt along both axes over two: about +s on a ridge whose sides tilt by s (as sine) and -s in a groove; 0
/// without a normal map.
float relief(const render::Scene& scene, const render::Hit& hit, const render::SurfacePoint& point,
             float distance);

}  // namespace patina::masks
