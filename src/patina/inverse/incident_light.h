// Light that arrives at a surface point, as a short list of directions with radiance and weight.
// Multiple-sample importance sampling [Veach1997, Sec. 9.2] over environment and emitters, the cosine and GGX
// lobes; every direction's weight uses the density of the whole mixture, so the list integrates any material,
// not just the one whose lobe helped to choose it.
#pragma once

#include <span>

#include "patina/base/random.h"
#include "patina/render/scene.h"

namespace patina::inverse {

/// One incident direction: reflected radiance is the sum over entries of eval_bsdf(wo, wi) ·
/// weighted_radiance.
struct IncidentLight {
  vec3 wi;
  vec3 weighted_radiance;  // radiance / Σ_s n_s p_s for sampled directions, irradiance for punctual lights
};

struct GatherOptions {
  int num_directions = 16;
  int max_depth = 4;  // path segments after the camera ray, as render::PathOptions counts them
};

/// Number of entries that gather_light fills: directions and punctual lights (at most kMaxLights of them,
/// chosen evenly).
inline constexpr int kMaxLights = 8;
int num_entries(const render::Scene& scene, const GatherOptions& options);

/// Fills `entries` (num_entries of them; unused ones carry no light) for a viewer in direction `wo`. The
/// material at `surface` places the narrow lobe and decides how the directions are shared out, nothing else.
void gather_light(const render::Scene& scene, const render::SurfacePoint& surface, const vec3& wo,
                  const GatherOptions& options, RandomStream& random, std::span<IncidentLight> entries);

}  // namespace patina::inverse
