#include "patina/masks/surface_shape.h"

#include <algorithm>
#include <cmath>

#include "patina/base/random.h"
#include "patina/render/frame.h"
#include "patina/render/sampling.h"
#include "patina/render/triangle.h"

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
           vec3 outward = render::triangle_of(primitive, hit->triangle).cross();
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
  const float area = render::triangle_of(primitive, hit.triangle).area();
  if (!(area > 0.0f)) return 0.0f;
  const vec2 uv = asset::map_uv(map, point.uv[set]);
  const float step = distance * std::sqrt(render::uv_area(primitive, hit.triangle, map) / area);  // in UV
  const auto tilt = [&](float du, float dv) { return asset::sample3(map, uv + vec2(du, dv)); };
  // The map's green points up, against v.
  return 0.5f * (tilt(step, 0).x - tilt(-step, 0).x + tilt(0, -step).y - tilt(0, step).y);
}

}  // namespace patina::masks
