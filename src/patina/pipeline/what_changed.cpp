#include "patina/pipeline/what_changed.h"

#include <algorithm>

#include "patina/asset/map_slots.h"
#include "patina/image/color.h"
#include "patina/render/triangle.h"
#include "patina/views/visibility.h"

namespace patina::pipeline {

using nlohmann::json;

namespace {

// Mean of a map with 1 or 3 channels over the surface of a material, by area.
vec3 surface_mean(const asset::Asset& asset, size_t material, const asset::Map& map) {
  size_t num_triangles = 0;
  for (const asset::Primitive& part : asset.primitives)
    if (static_cast<size_t>(part.material) == material) num_triangles += part.triangles.size();
  // A few large triangles show as much of the texture as many small ones.
  const size_t points = std::clamp<size_t>(50'000 / std::max<size_t>(num_triangles, 1), 1, 1024);
  glm::dvec3 sum(0.0);
  double area = 0;
  for (const asset::Primitive& part : asset.primitives) {
    if (static_cast<size_t>(part.material) != material) continue;
    const auto set = static_cast<size_t>(map.uv_set);
    for (uint32_t t = 0; t < part.triangles.size(); ++t) {
      const uvec3& corner = part.triangles[t];
      const double weight = render::triangle_of(part, t).area() / static_cast<double>(points);
      for (size_t i = 0; i < points; ++i) {
        // Additive recurrence: points that spread evenly for any number of them [Roberts2018].
        const auto n = static_cast<float>(i + 1);
        vec2 at = glm::fract(vec2(0.5f) + n * vec2(0.7548776662f, 0.5698402910f));
        if (at.x + at.y > 1.0f) at = vec2(1.0f) - at;
        vec2 uv(0.0f);
        if (set < part.uv.size())
          uv = (1.0f - at.x - at.y) * part.uv[set][corner.x] + at.x * part.uv[set][corner.y] +
               at.y * part.uv[set][corner.z];
        const vec2 uv_map = asset::map_uv(map, uv);
        sum += weight * glm::dvec3(map.texels.channels == 1 ? vec3(asset::sample1(map, uv_map))
                                                            : asset::sample3(map, uv_map));
        area += weight;
      }
    }
  }
  return area > 0 ? vec3(sum / area) : vec3(0.0f);
}

json srgb(const vec3& linear) {
  return {srgb_from_linear(linear.x), srgb_from_linear(linear.y), srgb_from_linear(linear.z)};
}

}  // namespace

json what_changed(const Workbench& bench, const FittedMaterials& fitted) {
  json list = json::array();
  for (size_t m = 0; m < fitted.maps.size(); ++m) {
    if (fitted.changed[m].none()) continue;
    json names = json::array();
    for (const asset::MapSlotRow& row : asset::kMapSlots)
      if (has(fitted.changed[m], row.slot)) names.push_back(row.title);
    const auto mean = [&](const asset::MaterialMaps& maps, asset::MapSlot slot) {
      return surface_mean(bench.asset, m, slot_map(maps, slot));
    };
    const asset::MaterialMaps &before = bench.maps[m], &after = fitted.maps[m];
    using asset::MapSlot;
    list.push_back(
        {{"material", before.name},
         {"changed", names},
         {"color", {srgb(mean(before, MapSlot::kBaseColor)), srgb(mean(after, MapSlot::kBaseColor))}},
         {"roughness", {mean(before, MapSlot::kRoughness).x, mean(after, MapSlot::kRoughness).x}},
         {"metallic", {mean(before, MapSlot::kMetallic).x, mean(after, MapSlot::kMetallic).x}},
         {"seen", views::seen_share(*bench.scene, bench.cameras, 1, static_cast<int>(m))}});
  }
  return list;
}

json what_was_not_seen(const Workbench& bench) {
  const views::UnseenSurface unseen = views::unseen_surface(*bench.scene, bench.cameras);
  return {{"down", unseen.down}, {"up", unseen.up}, {"sideways", unseen.sideways}};
}

}  // namespace patina::pipeline
