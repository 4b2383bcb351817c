// Light on composed surfaces: the glTF material model over baked light instead of rays. Internal to
// composition.
#pragma once

#include <ATen/core/Tensor.h>

#include "mini_data/fields.h"

namespace patina::mini_data {

/// [B,·,H,W] f32.
struct SurfaceValues {
  at::Tensor albedo;     // [B,3] linear Rec. 709
  at::Tensor roughness;  // [B,1] perceptual
  at::Tensor metallic;   // [B,1]
  at::Tensor height;     // [B,1] of the texture, [0,1], ½ is the middle
  at::Tensor bump;       // [B,3] what is added to the unit normal, world
};

/// Unit normals in world space with the bump, never turned away from the eye.
at::Tensor bumped_normal(const Fields& fields, const SurfaceValues& surface);

/// Radiance [B,3,H,W] toward the eye, in units of the object's mean light; samples of a plan share a mean
/// reflectance.
at::Tensor shaded(const Library& library, const Fields& fields, const SurfaceValues& surface,
                  int64_t num_plans);

/// [1,3,32,32] over (cosine of view, roughness), both at texel centres of [0,1]: the specular albedo of a
/// surface is F0 · [0] + [1] (Schlick's Fresnel split, as real-time renderers do [Karis2013]), and [2] what a
/// dielectric lets through to its diffuse part.
at::Tensor specular_albedo_table();

}  // namespace patina::mini_data
