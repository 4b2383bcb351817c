// The two reflection models as formulas over a scalar type: float for values, Dual for derivatives. One
// colour channel at a time, since neither model mixes channels. Internal to render; the interface is bsdf.h.
#pragma once

#include "patina/render/bsdf.h"
#include "patina/render/microfacet.h"

namespace patina::render {

inline constexpr float kDielectricF0 = 0.04f;  // index of refraction 1.5

/// The angles of one pair of directions; all cosines are positive.
template <class T>
struct ReflectionAngles {
  T n_o, n_i;  // normal with wo and wi
  T n_h;       // normal with half vector
  T sin2_h;    // 1 − n_h²
  float o_h;   // wo with half vector: does not depend on the normal
};

/// Everything but the base colour, shared by the three channels.
template <class T>
struct ReflectionFactors {
  T diffuse;   // f · |cos θi| of a white diffuse lobe
  T specular;  // D V · |cos θi|: the specular lobe without Fresnel
  float schlick;
  T metallic;
};

/// [glTF2, App. B.2]: mix(fresnel_mix(diffuse, specular), conductor_fresnel(specular), metallic).
template <class T>
ReflectionFactors<T> gltf_factors(const T& roughness, const T& metallic, const ReflectionAngles<T>& angles) {
  const T alpha = alpha_from_roughness(roughness);
  return {angles.n_i * kInvPi,
          ggx_distribution(alpha, angles.n_h, angles.sin2_h) * smith_visibility(alpha, angles.n_o) *
              smith_visibility(alpha, angles.n_i) * angles.n_i,
          schlick_weight(angles.o_h), metallic};
}

template <class T>
T gltf_channel(const T& base_color, const ReflectionFactors<T>& factors) {
  const float f_dielectric = kDielectricF0 + (1.0f - kDielectricF0) * factors.schlick;
  const T dielectric = base_color * factors.diffuse * (1.0f - f_dielectric) + factors.specular * f_dielectric;
  const T metal = (base_color + (1.0f - base_color) * factors.schlick) * factors.specular;
  return dielectric + factors.metallic * (metal - dielectric);
}

/// [Burley2012, Sec. 5] with specular 0.5 and all tints, sheen, clearcoat, anisotropy and subsurface at zero.
/// One change: masking uses the lobe's own alpha instead of (0.5 + roughness/2)², as [Burley2015] recommends
/// and Mitsuba 3 does, so that masking belongs to the distribution that is sampled.
template <class T>
ReflectionFactors<T> principled_factors(const T& roughness, const T& metallic,
                                        const ReflectionAngles<T>& angles) {
  const T fd90 = 0.5f + 2.0f * angles.o_h * angles.o_h * roughness;
  const T retro_o = 1.0f + (fd90 - 1.0f) * schlick_weight(angles.n_o);
  const T retro_i = 1.0f + (fd90 - 1.0f) * schlick_weight(angles.n_i);
  ReflectionFactors<T> factors = gltf_factors(roughness, metallic, angles);
  factors.diffuse = factors.diffuse * retro_o * retro_i;
  return factors;
}

template <class T>
T principled_channel(const T& base_color, const ReflectionFactors<T>& factors) {
  const T f0 = kDielectricF0 + factors.metallic * (base_color - kDielectricF0);
  const T fresnel = f0 + (1.0f - f0) * factors.schlick;
  return base_color * factors.diffuse * (1.0f - factors.metallic) + factors.specular * fresnel;
}

template <class T>
ReflectionFactors<T> reflection_factors(BsdfModel model, const T& roughness, const T& metallic,
                                        const ReflectionAngles<T>& angles) {
  return model == BsdfModel::kGltf ? gltf_factors(roughness, metallic, angles)
                                   : principled_factors(roughness, metallic, angles);
}

/// f · |cos θi| of one channel.
template <class T>
T reflection_channel(BsdfModel model, const T& base_color, const ReflectionFactors<T>& factors) {
  return model == BsdfModel::kGltf ? gltf_channel(base_color, factors)
                                   : principled_channel(base_color, factors);
}

}  // namespace patina::render
