// Shades the light cache and differentiates it, in closed form: reflected radiance = Σ eval_bsdf(wi) ·
// weighted radiance. No ray is cast. For the glTF model the sums run over arrays that the compiler turns into
// vector instructions; shade_reference does the same through render::eval_bsdf_gradient, is the definition,
// and serves every other model.
#pragma once

#include <span>
#include <vector>

#include "patina/inverse/light_cache.h"

namespace patina::inverse {

/// Shades one sample after the other, and keeps what the gradient of the last one needs. One a thread.
class Shader {
 public:
  explicit Shader(render::BsdfModel model) : model_(model) {}

  /// Radiance that a sample sends to the eye, [3] linear: emission and reflection. A sample whose
  /// normal turns (CacheSample::extent) reflects the mean of the GGX lobes over it (glTF model only). The
  /// arguments must live until the next call.
  vec3 shade(const CacheSample& sample, const Shading& shading, std::span<const PackedLight> lights);

  /// Gradient of dot(d_radiance, radiance of the sample shaded last) with respect to the map values.
  MapGradient adjoint(const vec3& d_radiance) const;

 private:
  render::BsdfModel model_;
  const CacheSample* sample_ = nullptr;
  const Shading* shading_ = nullptr;
  std::span<const PackedLight> lights_;
  std::vector<float> terms_;      // of every light (shade.cpp)
  vec3 sum_by_base_color_{0.0f};  // derivative of the radiance with respect to base colour
};

/// Value and gradient by the plain way, for any model; as if the normal did not turn within the sample.
struct ShadeResult {
  vec3 radiance{0.0f};
  MapGradient gradient;
};
ShadeResult shade_reference(render::BsdfModel model, const CacheSample& sample, const Shading& shading,
                            std::span<const PackedLight> lights, const vec3& d_radiance);

}  // namespace patina::inverse
