#include "patina/render/bsdf.h"

#include "patina/render/bsdf_models.h"
#include "patina/render/sampling.h"

namespace patina::render {
namespace {

/// Share of samples that go to the specular lobe: its estimated part of the reflected light, kept within
/// bounds so that neither lobe is ever starved where both reflect.
float specular_probability(BsdfModel model, const BsdfParams& params, const vec3& wo) {
  const float schlick = schlick_weight(wo.z);
  const float albedo = luminance(params.base_color);
  const float f0 = kDielectricF0 + params.metallic * (albedo - kDielectricF0);
  const float fresnel = f0 + (1.0f - f0) * schlick;
  const float f_dielectric = kDielectricF0 + (1.0f - kDielectricF0) * schlick;
  const float transmitted = model == BsdfModel::kGltf ? 1.0f - f_dielectric : 1.0f;
  const float diffuse = (1.0f - params.metallic) * albedo * transmitted;
  if (!(diffuse > 0.0f)) return 1.0f;
  return glm::clamp(fresnel / (fresnel + diffuse), 0.1f, 0.9f);
}

bool below_surface(const vec3& wo, const vec3& wi) {
  return !(wo.z > 0.0f && wi.z > 0.0f);
}

ReflectionAngles<float> angles_in_frame(const vec3& wo, const vec3& wi) {
  const vec3 h = glm::normalize(wo + wi);
  return {wo.z, wi.z, h.z, h.x * h.x + h.y * h.y, glm::dot(wo, h)};
}

/// The density of reflected visible normals, 1/sr: D_wo(h) / (4 wo·h) with G1 written through
/// smith_visibility.
float specular_pdf(float alpha, const ReflectionAngles<float>& angles) {
  return 0.5f * smith_visibility(alpha, angles.n_o) * ggx_distribution(alpha, angles.n_h, angles.sin2_h);
}

}  // namespace

vec3 eval_bsdf(BsdfModel model, const BsdfParams& params, const vec3& wo, const vec3& wi) {
  return evaluate_bsdf(model, params, wo, wi).value;
}

float pdf_bsdf(BsdfModel model, const BsdfParams& params, const vec3& wo, const vec3& wi) {
  return evaluate_bsdf(model, params, wo, wi).pdf;
}

BsdfEvaluation evaluate_bsdf(BsdfModel model, const BsdfParams& params, const vec3& wo, const vec3& wi) {
  BsdfEvaluation out;
  if (below_surface(wo, wi)) return out;
  const ReflectionAngles<float> angles = angles_in_frame(wo, wi);
  const auto factors = reflection_factors(model, params.roughness, params.metallic, angles);
  for (int c = 0; c < 3; ++c) out.value[c] = reflection_channel(model, params.base_color[c], factors);
  const float p_specular = specular_probability(model, params, wo);
  out.pdf = p_specular * specular_pdf(alpha_from_roughness(params.roughness), angles) +
            (1.0f - p_specular) * wi.z * kInvPi;
  return out;
}

BsdfSample sample_bsdf(BsdfModel model, const BsdfParams& params, const vec3& wo, float u_lobe,
                       const vec2& u) {
  if (!(wo.z > 0.0f)) return {};
  vec3 wi;
  if (u_lobe < specular_probability(model, params, wo)) {
    const vec3 h = sample_visible_normal(alpha_from_roughness(params.roughness), wo, u);
    wi = glm::normalize(2.0f * glm::dot(wo, h) * h - wo);
  } else {
    wi = sample_cosine_hemisphere(u);
  }
  // A microfacet may reflect below the horizon: that light is what single scattering loses.
  if (!(wi.z > 0.0f)) return {};
  const BsdfEvaluation evaluation = evaluate_bsdf(model, params, wo, wi);
  if (!(evaluation.pdf > 0.0f)) return {};
  return {wi, evaluation.value / evaluation.pdf, evaluation.pdf};
}

BsdfGradient eval_bsdf_gradient(BsdfModel model, const BsdfParams& params, const vec3& n_world,
                                const vec3& wo_world, const vec3& wi_world) {
  // Slots: the channel's own base colour, roughness, metallic, and the normal's three components.
  enum : size_t { kBase, kRoughness, kMetallic, kNormal, kSlots = 6 };
  using D = Dual<kSlots>;

  BsdfGradient out;
  const vec3 n = n_world;
  const float n_o = glm::dot(n, wo_world), n_i = glm::dot(n, wi_world);
  if (!(n_o > 0.0f && n_i > 0.0f)) return out;
  const vec3 h = glm::normalize(wo_world + wi_world);
  const float n_h = glm::dot(n, h);

  // d (n·v) / dn = v. sin²θh = |n × h|², whose derivative is 2 (|h|² n − (n·h) h) when n moves freely.
  const auto with_normal = [](float value, const vec3& slope) {
    D x(value);
    for (int i = 0; i < 3; ++i) x.d[kNormal + static_cast<size_t>(i)] = slope[i];
    return x;
  };
  const vec3 n_cross_h = glm::cross(n, h);
  ReflectionAngles<D> angles;
  angles.n_o = with_normal(n_o, wo_world);
  angles.n_i = with_normal(n_i, wi_world);
  angles.n_h = with_normal(n_h, h);
  angles.sin2_h = with_normal(glm::dot(n_cross_h, n_cross_h), 2.0f * (n - n_h * h));
  angles.o_h = glm::dot(wo_world, h);

  const auto factors =
      reflection_factors(model, D(params.roughness, kRoughness), D(params.metallic, kMetallic), angles);
  for (int c = 0; c < 3; ++c) {
    const D value = reflection_channel(model, D(params.base_color[c], kBase), factors);
    out.value[c] = value.v;
    out.d_base_color[c] = value.d[kBase];
    out.d_roughness[c] = value.d[kRoughness];
    out.d_metallic[c] = value.d[kMetallic];
    out.d_normal[c] = vec3(value.d[kNormal], value.d[kNormal + 1], value.d[kNormal + 2]);
  }
  return out;
}

}  // namespace patina::render
