#include "patina/masks/surface_shape.h"

#include <algorithm>
#include <cmath>

#include "patina/base/random.h"
#include "patina/render/frame.h"
#include "patina/render/sampling.h"

namespace patina::masks {
namespace {

// Mean over directions around `axis`, drawn in proportion to their cosine, of value(direction).
template <class Value>
float mean_around(const vec3& axis, const ShapeRays& rays, Value value) {
  const render::Frame frame(axis);
  float sum = 0;
  for (int k = 0; k < rays.count; ++k) {
    RandomStream random =
        RandomStream::even(rays.seed, RandomPurpose::kMasks, rays.index, static_cast<uint32_t>(k));
    sum += value(frame.to_world(render::sample_cosine_hemisphere(random.uniform2())));
  }
  return sum / static_cast<float>(rays.count);
}

}  // namespace

float closed_in(const render::Scene& scene, const render::SurfacePoint& point, float range,
                const ShapeRays& rays) {
  return mean_around(point.n_geometric, rays, [&](const vec3& direction) {
    render::Ray ray = render::spawn_ray(point, direction);
    ray.t_max = range;
    return scene.occluded(ray) ? 1.0f : 0.0f;
  });
}

float bends_away(const render::Scene& scene, const render::SurfacePoint& point, float range,
                 const ShapeRays& rays) {
  return 2.0f * mean_around(-point.n_geometric, rays, [&](const vec3& direction) {
           render::Ray ray = render::spawn_ray(point, direction);
           ray.t_max = range;
           const auto hit = scene.intersect(ray);
           if (!hit || static_cast<int>(hit->primitive) >= scene.num_asset_primitives()) return 0.0f;
           const asset::Primitive& primitive = *scene.primitives()[hit->primitive];
           const uvec3& corner = primitive.triangles[hit->triangle];
           const auto& p = primitive.p_world;
           vec3 outward = glm::cross(p[corner.y] - p[corner.x], p[corner.z] - p[corner.x]);
           const float length = glm::length(outward);
           if (!(length > 0.0f)) return 0.0f;
           outward /= glm::dot(outward, direction) < 0.0f ? -length : length;  // the ray leaves there
           return std::clamp(1.0f + glm::dot(outward, point.n_geometric), 0.0f, 1.0f);
         });
}

float relief(const render::Scene& scene, const render::Hit& hit, const render::SurfacePoint& point,
             float distance) {
  const asset::Map& map = scene.materials()[static_cast<size_t>(point.material)].normal;
  const auto set = static_cast<size_t>(map.uv_set);
  if (map.texels.num_pixels() == 1 || set >= point.num_uv_sets) return 0.0f;
  const asset::Primitive& primitive = *scene.primitives()[hit.primitive];
  const uvec3& corner = primitive.triangles[hit.triangle];
  const auto& p = primitive.p_world;
  const vec2 uv = asset::map_uv(map, point.uv[set]), a = asset::map_uv(map, primitive.uv[set][corner.x]),
             b = asset::map_uv(map, primitive.uv[set][corner.y]) - a,
             c = asset::map_uv(map, primitive.uv[set][corner.z]) - a;
  const float area = glm::length(glm::cross(p[corner.y] - p[corner.x], p[corner.z] - p[corner.x]));
  if (!(area > 0.0f)) return 0.0f;
  const float step = distance * std::sqrt(std::abs(b.x * c.y - b.y * c.x) / area);  // in UV
  const auto tilt = [&](float du, float dv) { return asset::sample3(map, uv + vec2(du, dv)); };
  // The map's green points up, against v.
  return 0.5f * (tilt(step, 0).x - tilt(-step, 0).x + tilt(0, -step).y - tilt(0, step).y);
}

}  // namespace patina::masks
