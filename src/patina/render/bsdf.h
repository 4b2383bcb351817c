// Surface reflection. Two models stand behind one interface: glTF 2.0 metallic-roughness [glTF2, App. B] and
// Burley's principled model [Burley2012]. Written once over a scalar type, so that forward-mode derivatives
// (dual.h) come from the same lines. All directions are unit vectors in the shading frame (z = shading
// normal) and point away from the surface.
#pragma once

#include "patina/base/math.h"

namespace patina::render {

enum class BsdfModel { kGltf, kPrincipled };

struct BsdfParams {
  vec3 base_color{1.0f};   // linear, [0,1]
  float roughness = 1.0f;  // perceptual; alpha = max(roughness², kMinAlpha)
  float metallic = 0.0f;
};

/// f · |cos θi|, [3], 1/sr. Zero where wo or wi lies below the surface.
vec3 eval_bsdf(BsdfModel model, const BsdfParams& params, const vec3& wo, const vec3& wi);

/// Density of sample_bsdf, per steradian.
float pdf_bsdf(BsdfModel model, const BsdfParams& params, const vec3& wo, const vec3& wi);

/// Both at once, for less than twice the work.
struct BsdfEvaluation {
  vec3 value{0.0f};  // eval_bsdf
  float pdf = 0.0f;  // pdf_bsdf
};
BsdfEvaluation evaluate_bsdf(BsdfModel model, const BsdfParams& params, const vec3& wo, const vec3& wi);

struct BsdfSample {
  vec3 wi;
  vec3 weight;    // f · |cos θi| / pdf
  float pdf = 0;  // 0: no sample
};
BsdfSample sample_bsdf(BsdfModel model, const BsdfParams& params, const vec3& wo, float u_lobe,
                       const vec2& u);

/// f · |cos θi| with its derivatives. The shading normal n (world space) enters too, since wo and wi in the
/// shading frame depend on it: wo_world and wi_world are fixed. Derivatives of each colour channel c of the
/// value:
///   d_base_color[c]   with respect to base_color[c] (channels do not mix in kGltf; in kPrincipled the cross
///   terms through
///                     luminance appear only in tint lobes that patina does not expose)
///   d_roughness[c], d_metallic[c], d_normal[c] (a vector: with respect to n_world's three components, n
///   unconstrained)
struct BsdfGradient {
  vec3 value{0.0f};
  vec3 d_base_color{0.0f};
  vec3 d_roughness{0.0f};
  vec3 d_metallic{0.0f};
  vec3 d_normal[3]{vec3(0.0f), vec3(0.0f), vec3(0.0f)};
};
BsdfGradient eval_bsdf_gradient(BsdfModel model, const BsdfParams& params, const vec3& n_world,
                                const vec3& wo_world, const vec3& wi_world);

}  // namespace patina::render
