#include "patina/inverse/material_point.h"

#include "patina/inverse/fit_slots.h"
#include "patina/render/shading_normal.h"

namespace patina::inverse {

MaterialPoint material_point(const render::SurfacePoint& surface, const vec3& wo,
                             const asset::MaterialMaps& maps) {
  MaterialPoint point;
  point.material = static_cast<uint16_t>(surface.material);
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    const asset::Map& map = maps.*row.map;
    const auto set = static_cast<size_t>(map.uv_set);
    const vec2 uv = set < surface.num_uv_sets && set < surface.uv.size() ? surface.uv[set] : vec2(0.0f);
    point.uv[index_of(row.slot)] = asset::map_uv(map, uv);
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
  MapValues values;
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    const asset::Map& map = maps.*row.map;
    const vec2& uv = point.uv[index_of(row.slot)];
    // One tap serves neighbouring slots that lie alike.
    if (!last || uv != last_uv || !asset::same_layout(*last, map)) tap = asset::bilinear_tap(map, uv);
    last = &map, last_uv = uv;
    float* value = values_of(values, row.slot);
    if (row.channels == 1) {
      *value = asset::read1(map, tap);
    } else {
      const vec3 three = asset::read3(map, tap);
      value[0] = three.x, value[1] = three.y, value[2] = three.z;
    }
  }
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
    for (const asset::MapSlotRow& row : asset::kMapSlots) {
      const Image& texels = (maps[m].*row.map).texels;
      gradients.slots[m][index_of(row.slot)] = Image(texels.width, texels.height, texels.channels);
    }
  return gradients;
}

void splat(TexelGradients& texels, const asset::MaterialMaps& maps, const MaterialPoint& point,
           const MapGradient& gradient) {
  // Context materials lie behind the asset's: they have no gradients.
  if (point.material >= texels.slots.size()) return;
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    const size_t s = index_of(row.slot);
    Image& image = texels.slots[point.material][s];
    const asset::BilinearTap tap = asset::bilinear_tap(maps.*row.map, point.uv[s]);
    const float* values = values_of(gradient, row.slot);
    for (size_t t = 0; t < 4; ++t)
      for (int c = 0; c < image.channels; ++c)
        image.pixels[static_cast<size_t>(tap.texel[t]) * static_cast<size_t>(image.channels) +
                     static_cast<size_t>(c)] += tap.weight[t] * values[c];
  }
}

}  // namespace patina::inverse
