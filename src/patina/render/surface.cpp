// From a hit to what shading needs: position with its uncertainty, frames, maps.
#include <algorithm>

#include "patina/base/check.h"
#include "patina/render/scene_state.h"
#include "patina/render/shading_normal.h"

namespace patina::render {
namespace {

// Offsets are this share of the largest coordinate involved: 16 units in the last place. Embree's robust
// intersection and the rounding of a position stay within a few.
constexpr float kOffsetShare = 0x1p-19f;

float max_abs(const vec3& v) {
  return max_component(glm::abs(v));
}

float lookup1(const asset::Map& map, const vec2& uv_map) {
  return map.texels.num_pixels() == 1 ? map.texels.pixels[0] : asset::sample1(map, uv_map);
}
vec3 lookup3(const asset::Map& map, const vec2& uv_map) {
  return map.texels.num_pixels() == 1 ? map.texels.rgb(0, 0) : asset::sample3(map, uv_map);
}

/// Reads several maps at one point; maps of one layout share their tap.
class MapReader {
 public:
  explicit MapReader(const SurfacePoint& point) : point_(point) {}

  float read1(const asset::Map& map) {
    return map.texels.num_pixels() == 1 ? map.texels.pixels[0] : asset::read1(map, tap_of(map));
  }
  vec3 read3(const asset::Map& map) {
    return map.texels.num_pixels() == 1 ? map.texels.rgb(0, 0) : asset::read3(map, tap_of(map));
  }

 private:
  const asset::BilinearTap& tap_of(const asset::Map& map) {
    if (!last_ || !asset::same_layout(*last_, map)) {
      const auto set = static_cast<size_t>(map.uv_set);
      tap_ = asset::bilinear_tap(map,
                                 asset::map_uv(map, set < point_.num_uv_sets ? point_.uv[set] : vec2(0.0f)));
      last_ = &map;
    }
    return tap_;
  }

  const SurfacePoint& point_;
  const asset::Map* last_ = nullptr;
  asset::BilinearTap tap_{};
};

vec3 normalized_or(const vec3& v, const vec3& fallback) {
  const float length = glm::length(v);
  return length > 0.0f && std::isfinite(length) ? v / length : fallback;
}

}  // namespace

float opacity_at(const asset::MaterialMaps& material, const asset::Primitive& primitive, uint32_t triangle,
                 const vec2& barycentric) {
  if (material.alpha_mode == asset::AlphaMode::kOpaque) return 1.0f;
  const uvec3& t = primitive.triangles[triangle];
  float alpha = lookup1(material.alpha, map_uv_at(material.alpha, primitive, t, barycentric));
  if (!primitive.color.empty()) alpha *= interpolate(primitive.color, t, barycentric).a;
  if (material.alpha_mode == asset::AlphaMode::kMask) return alpha < material.alpha_cutoff ? 0.0f : 1.0f;
  return glm::clamp(alpha, 0.0f, 1.0f);
}

vec3 emission_at(const asset::MaterialMaps& material, const asset::Primitive& primitive, uint32_t triangle,
                 const vec2& barycentric) {
  return lookup3(material.emission,
                 map_uv_at(material.emission, primitive, primitive.triangles[triangle], barycentric));
}

SurfacePoint Scene::surface(const Ray& ray, const Hit& hit,
                            std::span<const asset::MaterialMaps> asset_materials) const {
  const asset::Primitive& primitive = *state_->primitives[hit.primitive];
  const uvec3& t = primitive.triangles[hit.triangle];
  const vec2 w = hit.barycentric;
  SurfacePoint out;
  out.material = state_->material_of_primitive[hit.primitive];

  // Position and geometric normal in double: from barycentrics the position lies on the triangle wherever the
  // eye is, and edges of any length (1e-20 to 1e18) have a normal.
  const glm::dvec3 a(primitive.p_world[t.x]), b(primitive.p_world[t.y]), c(primitive.p_world[t.z]);
  out.p_world = vec3(a + static_cast<double>(w.x) * (b - a) + static_cast<double>(w.y) * (c - a));
  out.offset = kOffsetShare * std::max({max_abs(vec3(a)), max_abs(vec3(b)), max_abs(vec3(c))});
  const glm::dvec3 cross = glm::cross(b - a, c - a);
  const double cross_length = glm::length(cross);
  const vec3 n_front = cross_length > 0 ? vec3(cross / cross_length) : -ray.direction;
  out.front_face = glm::dot(n_front, ray.direction) <= 0.0f;
  out.n_geometric = out.front_face ? n_front : -n_front;

  // The frame of the normal map. Seen from behind, normal, tangent and bitangent all turn round [glTF2,
  // Sec. 3.7.2.1 and 3.9.6]; so does a vertex normal that contradicts the winding.
  vec3 n = primitive.n_world.empty() ? n_front : normalized_or(interpolate(primitive.n_world, t, w), n_front);
  vec3 tangent, bitangent;
  if (primitive.tangent_world.empty()) {
    const Basis basis = orthonormal_basis(n);
    tangent = basis.tangent, bitangent = basis.bitangent;
  } else {
    tangent = normalized_or(vec3(interpolate(primitive.tangent_world, t, w)), orthonormal_basis(n).tangent);
    bitangent = std::copysign(1.0f, primitive.tangent_world[t.x].w) * glm::cross(n, tangent);
  }
  if (glm::dot(n, out.n_geometric) < 0.0f) n = -n, tangent = -tangent, bitangent = -bitangent;
  out.n_interpolated = n;
  out.tangent = tangent;
  out.bitangent = bitangent;

  out.num_uv_sets = std::min(primitive.uv.size(), out.uv.size());
  for (size_t set = 0; set < out.num_uv_sets; ++set)
    if (!primitive.uv[set].empty()) out.uv[set] = interpolate(primitive.uv[set], t, w);
  if (!primitive.color.empty()) out.vertex_color = vec3(interpolate(primitive.color, t, w));

  const auto m = static_cast<size_t>(out.material);
  const asset::MaterialMaps& material =
      m < asset_materials.size() ? asset_materials[m] : state_->materials[m];
  MapReader maps(out);
  out.bsdf.base_color = glm::clamp(maps.read3(material.base_color) * out.vertex_color, 0.0f, 1.0f);
  out.bsdf.roughness = glm::clamp(maps.read1(material.roughness), 0.0f, 1.0f);
  out.bsdf.metallic = glm::clamp(maps.read1(material.metallic), 0.0f, 1.0f);
  out.emission = maps.read3(material.emission);

  const vec3 n_map = maps.read3(material.normal);
  const vec3 n_mapped = normalized_or(n_map.x * tangent + n_map.y * bitangent + n_map.z * n, n);
  out.n_shading = visible_shading_normal(n_mapped, out.n_geometric, -ray.direction);
  return out;
}

Ray spawn_ray(const SurfacePoint& point, const vec3& direction) {
  const float side = glm::dot(direction, point.n_geometric) < 0.0f ? -1.0f : 1.0f;
  Ray ray;
  ray.origin = point.p_world + side * point.offset * point.n_geometric;
  ray.direction = direction;
  return ray;
}

Ray spawn_segment(const SurfacePoint& point, const vec3& p_target) {
  Ray ray = spawn_ray(point, p_target - point.p_world);
  const vec3 to_target = p_target - ray.origin;
  const float distance = glm::length(to_target);
  ray.direction = distance > 0.0f ? to_target / distance : point.n_geometric;
  // The target's own uncertainty, and the relative error of Embree's distance.
  ray.t_max = std::max(0.0f, distance * (1.0f - 1e-4f) - kOffsetShare * max_abs(p_target));
  return ray;
}

}  // namespace patina::render
