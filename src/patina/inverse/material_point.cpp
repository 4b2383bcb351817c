#include "patina/inverse/material_point.h"

#include "patina/render/shading_normal.h"

namespace patina::inverse {

asset::Map& slot_map(asset::MaterialMaps& maps, Slot slot) {
  switch (slot) {
    case Slot::kBaseColor:
      return maps.base_color;
    case Slot::kRoughness:
      return maps.roughness;
    case Slot::kMetallic:
      return maps.metallic;
    case Slot::kNormal:
      break;
  }
  return maps.normal;
}

const asset::Map& slot_map(const asset::MaterialMaps& maps, Slot slot) {
  return slot_map(const_cast<asset::MaterialMaps&>(maps), slot);
}

MaterialPoint material_point(const render::SurfacePoint& surface, const vec3& wo,
                             const asset::MaterialMaps& maps) {
  MaterialPoint point;
  point.material = static_cast<uint16_t>(surface.material);
  for (const Slot slot : kSlots) {
    const asset::Map& map = slot_map(maps, slot);
    const auto set = static_cast<size_t>(map.uv_set);
    const vec2 uv = set < surface.num_uv_sets && set < surface.uv.size() ? surface.uv[set] : vec2(0.0f);
    point.uv[static_cast<size_t>(slot)] = asset::map_uv(map, uv);
  }
  point.vertex_color = surface.vertex_color;
  point.tangent = surface.tangent;
  point.bitangent = surface.bitangent;
  point.n_interpolated = surface.n_interpolated;
  point.n_geometric = surface.n_geometric;
  point.wo = wo;
  return point;
}

MapValues sample_maps(const asset::MaterialMaps& maps, const MaterialPoint& point) {
  const asset::Map* last = nullptr;
  vec2 last_uv(0.0f);
  asset::BilinearTap tap{};
  const auto tap_of = [&](Slot slot) -> const asset::BilinearTap& {
    const asset::Map& map = slot_map(maps, slot);
    const vec2& uv = point.uv[static_cast<size_t>(slot)];
    if (!last || uv != last_uv || !asset::same_layout(*last, map)) tap = asset::bilinear_tap(map, uv);
    last = &map, last_uv = uv;
    return tap;
  };
  MapValues values;
  values.base_color = asset::read3(maps.base_color, tap_of(Slot::kBaseColor));
  values.roughness = asset::read1(maps.roughness, tap_of(Slot::kRoughness));
  values.metallic = asset::read1(maps.metallic, tap_of(Slot::kMetallic));
  values.normal = asset::read3(maps.normal, tap_of(Slot::kNormal));
  return values;
}

Shading shade_values(const MaterialPoint& point, const MapValues& values) {
  Shading shading;
  shading.bsdf.base_color = glm::clamp(values.base_color * point.vertex_color, 0.0f, 1.0f);
  shading.bsdf.roughness = glm::clamp(values.roughness, 0.0f, 1.0f);
  shading.bsdf.metallic = glm::clamp(values.metallic, 0.0f, 1.0f);
  const vec3 unnormalised = point.tangent * values.normal.x + point.bitangent * values.normal.y +
                            point.n_interpolated * values.normal.z;
  const float inverse_length = 1.0f / glm::length(unnormalised);
  const vec3 n_mapped = unnormalised * inverse_length;
  shading.n_world = render::visible_shading_normal(n_mapped, point.n_geometric, point.wo);
  shading.d_normal_scale = shading.n_world == n_mapped ? inverse_length : 0.0f;
  return shading;
}

MapGradient map_gradient(const MaterialPoint& point, const Shading& shading, const vec3& d_base_color,
                         float d_roughness, float d_metallic, const vec3& d_normal) {
  MapGradient gradient;
  gradient.base_color = d_base_color * point.vertex_color;
  gradient.roughness = d_roughness;
  gradient.metallic = d_metallic;
  // n = u/|u|, so dn = (I − n nᵀ) du / |u|; then back through the frame.
  const vec3& n = shading.n_world;
  const vec3 d_unnormalised = (d_normal - n * glm::dot(n, d_normal)) * shading.d_normal_scale;
  gradient.normal = vec3(glm::dot(point.tangent, d_unnormalised), glm::dot(point.bitangent, d_unnormalised),
                         glm::dot(point.n_interpolated, d_unnormalised));
  return gradient;
}

TexelGradients zero_gradients(const std::vector<asset::MaterialMaps>& maps, int num_materials) {
  TexelGradients gradients;
  gradients.slots.resize(static_cast<size_t>(num_materials));
  for (size_t m = 0; m < gradients.slots.size(); ++m)
    for (const Slot slot : kSlots) {
      const Image& texels = slot_map(maps[m], slot).texels;
      gradients.slots[m][static_cast<size_t>(slot)] = Image(texels.width, texels.height, texels.channels);
    }
  return gradients;
}

void splat(TexelGradients& texels, const asset::MaterialMaps& maps, const MaterialPoint& point,
           const MapGradient& gradient) {
  // Context materials lie behind the asset's: they have no gradients.
  if (point.material >= texels.slots.size()) return;
  for (const Slot slot : kSlots) {
    const auto s = static_cast<size_t>(slot);
    Image& image = texels.slots[point.material][s];
    const asset::BilinearTap tap = asset::bilinear_tap(slot_map(maps, slot), point.uv[s]);
    const float values[kNumSlots][3] = {{gradient.base_color.x, gradient.base_color.y, gradient.base_color.z},
                                        {gradient.roughness, 0, 0},
                                        {gradient.metallic, 0, 0},
                                        {gradient.normal.x, gradient.normal.y, gradient.normal.z}};
    for (size_t t = 0; t < 4; ++t)
      for (int c = 0; c < image.channels; ++c)
        image.pixels[static_cast<size_t>(tap.texel[t]) * static_cast<size_t>(image.channels) +
                     static_cast<size_t>(c)] += tap.weight[t] * values[s][c];
  }
}

}  // namespace patina::inverse
