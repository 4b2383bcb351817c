// Shades the light cache and differentiates it, in closed form: reflected radiance = Σ eval_bsdf(wi) ·
// weighted radiance. No ray is cast. For the glTF model the sums run over arrays that the compiler turns into
// vector instructions; shade_reference does the same through render::eval_bsdf_gradient, is the definition,
// and serves every other model.
#pragma once

#include <span>

#include "patina/inverse/light_cache.h"

namespace patina::inverse {

/// Radiance that a sample sends to the eye, [3] linear: emission and reflection.
vec3 shade(render::BsdfModel model, const CacheSample& sample, const Shading& shading,
           std::span<const PackedLight> lights);

/// Gradient of dot(d_radiance, shade(...)) with respect to the map values.
MapGradient shade_adjoint(render::BsdfModel model, const CacheSample& sample, const Shading& shading,
                          std::span<const PackedLight> lights, const vec3& d_radiance);

/// Value and gradient by the plain way, for any model.
struct ShadeResult {
  vec3 radiance{0.0f};
  MapGradient gradient;
};
ShadeResult shade_reference(render::BsdfModel model, const CacheSample& sample, const Shading& shading,
                            std::span<const PackedLight> lights, const vec3& d_radiance);

}  // namespace patina::inverse
