// What Scene keeps behind its interface, and the material look-ups that scene.cpp, surface.cpp and lights.cpp
// share. Internal to render.
#pragma once

#include <vector>

#include <embree3/rtcore.h>

#include "patina/render/lights.h"
#include "patina/render/scene.h"

namespace patina::render {

struct Scene::State {
  std::vector<const asset::Primitive*> primitives;  // asset's, then context's
  std::vector<int> material_of_primitive;           // into `materials`
  std::vector<asset::MaterialMaps> materials;       // asset's, then context's
  std::vector<asset::Light> punctual_lights;
  int num_asset_primitives = 0, num_asset_materials = 0;
  bool has_blend = false;  // whether any primitive's material is alpha blended
  Environment environment;
  BsdfModel bsdf_model;
  asset::Bounds bounds{};
  Lights lights;
  RTCDevice device = nullptr;
  RTCScene embree = nullptr;

  State(Environment environment_, BsdfModel bsdf_model_)
      : environment(std::move(environment_)), bsdf_model(bsdf_model_) {}
  ~State() {
    if (embree) rtcReleaseScene(embree);
    if (device) rtcReleaseDevice(device);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  const asset::MaterialMaps& material(uint32_t primitive) const {
    return materials[static_cast<size_t>(material_of_primitive[primitive])];
  }
};

/// `values` interpolated over a triangle.
template <class V>
V interpolate(const std::vector<V>& values, const uvec3& triangle, const vec2& barycentric) {
  return (1.0f - barycentric.x - barycentric.y) * values[triangle.x] + barycentric.x * values[triangle.y] +
         barycentric.y * values[triangle.z];
}

/// The UV that `map` reads at a point of a triangle; (0,0) where the mesh lacks the set.
inline vec2 map_uv_at(const asset::Map& map, const asset::Primitive& primitive, const uvec3& triangle,
                      const vec2& barycentric) {
  const auto set = static_cast<size_t>(map.uv_set);
  if (set >= primitive.uv.size() || primitive.uv[set].empty()) return asset::map_uv(map, vec2(0.0f));
  return asset::map_uv(map, interpolate(primitive.uv[set], triangle, barycentric));
}

/// Opacity of a point, [0,1], vertex colour's alpha included; masked materials give 0 or 1.
float opacity_at(const asset::MaterialMaps& material, const asset::Primitive& primitive, uint32_t triangle,
                 const vec2& barycentric);

/// Emitted radiance of a point, W/m²/sr.
vec3 emission_at(const asset::MaterialMaps& material, const asset::Primitive& primitive, uint32_t triangle,
                 const vec2& barycentric);

}  // namespace patina::render
