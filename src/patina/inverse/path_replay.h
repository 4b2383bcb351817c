// A plain differentiable path tracer: the reference against which the light cache's gradients are tested.
// Paths are sampled as the renderer samples them, with the present materials; then directions, densities,
// weights and roulette are held fixed ("detached") while the reflected light along them follows the textures
// ("attached"), which is unbiased [Vicini2021, Sec. 3]. Vicini et al. replay a path from its random numbers
// to spare a GPU's memory; here its few vertices are kept, and so light may be zero in a channel, where
// replay would divide by it.
#pragma once

#include <vector>

#include "patina/inverse/material_point.h"
#include "patina/render/path_tracer.h"

namespace patina::inverse {

/// Light that reaches a vertex along a fixed direction; the weight holds 1/pdf and the multiple-sample
/// weight.
struct PathConnection {
  vec3 wi{0.0f};
  vec3 weighted_radiance{0.0f};
};

struct PathVertex {
  MaterialPoint point;
  vec3 weighted_emission{0.0f};
  std::vector<PathConnection> connections;  // at most two: environment or emitter, punctual light
  vec3 wi_next{0.0f};                       // where the path goes on
  float next_weight = 0;                    // 1/(pdf · survival); 0: it ends here
};

/// A sampled path from a camera ray on. Its estimate of radiance: path_radiance.
struct PathRecord {
  std::vector<PathVertex> vertices;
  vec3 weighted_escape{0.0f};  // environment where the last direction left the scene
};
PathRecord record_path(const render::Scene& scene, const render::Ray& ray, const render::PathOptions& options,
                       RandomStream& random);

/// Radiance of the recorded path for textures `maps` (asset's, then context's materials), [3] linear.
vec3 path_radiance(const PathRecord& path, const std::vector<asset::MaterialMaps>& maps,
                   render::BsdfModel model);

/// Adds the gradient of dot(d_radiance, path_radiance) with respect to all texels on the path.
void add_path_gradient(const PathRecord& path, const std::vector<asset::MaterialMaps>& maps,
                       render::BsdfModel model, const vec3& d_radiance, TexelGradients& gradients);

}  // namespace patina::inverse
