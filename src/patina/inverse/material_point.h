// A surface point as the unknown textures see it: what is fixed (UVs, tangent frame, vertex colour), what the
// maps are worth there, and the chain rule from reflected light back to the maps' texels. Light cache and
// path replay share it.
#pragma once

#include <array>
#include <vector>

#include "patina/asset/map_slots.h"
#include "patina/render/scene.h"

namespace patina::inverse {

/// Bilinear values of the maps that can be fitted. `normal` is the interpolated tangent-space vector, not
/// normalised.
struct MapValues {
  vec3 base_color{0.0f};
  float roughness = 0;
  float metallic = 0;
  vec3 normal{0.0f, 0.0f, 1.0f};
};

/// The part of a surface point that no texture changes.
struct MaterialPoint {
  uint16_t material = 0;
  std::array<vec2, asset::kNumMapSlots> uv{};  // map_uv of each slot
  vec3 vertex_color{1.0f};
  vec3 tangent{1, 0, 0}, bitangent{0, 1, 0}, n_interpolated{0, 0, 1};
  vec3 n_geometric{0, 0, 1};
  vec3 wo{0, 0, 1};  // unit, toward the viewer
};

MaterialPoint material_point(const render::SurfacePoint& surface, const vec3& wo,
                             const asset::MaterialMaps& maps);

MapValues sample_maps(const asset::MaterialMaps& maps, const MaterialPoint& point);

/// What the BSDF gets: parameters with vertex colour, and the shading normal in world space.
struct Shading {
  render::BsdfParams bsdf;
  vec3 n_world{0, 0, 1};
  float d_normal_scale = 1;  // 1/|frame · map value|; 0 where the normal had to be turned toward the viewer:
                             // there the map's own direction is not what is seen, and it gets no gradient
};
Shading shade_values(const MaterialPoint& point, const MapValues& values);

/// Derivative of a scalar with respect to MapValues (all three normal components, unconstrained).
using MapGradient = MapValues;
inline MapGradient zero_gradient() {
  return {vec3(0.0f), 0.0f, 0.0f, vec3(0.0f)};
}

/// Chain rule from the BSDF's inputs to the map values. `d_normal` is with respect to n_world, unconstrained.
MapGradient map_gradient(const MaterialPoint& point, const Shading& shading, const vec3& d_base_color,
                         float d_roughness, float d_metallic, const vec3& d_normal);

/// Gradients over all texels of the asset's materials: same shapes as the maps.
struct TexelGradients {
  std::vector<std::array<Image, asset::kNumMapSlots>> slots;  // [material][slot]
};
TexelGradients zero_gradients(const std::vector<asset::MaterialMaps>& maps, int num_materials);

/// The adjoint of sample_maps: adds `gradient` to the texels that the look-up read.
void splat(TexelGradients& texels, const asset::MaterialMaps& maps, const MaterialPoint& point,
           const MapGradient& gradient);

}  // namespace patina::inverse
