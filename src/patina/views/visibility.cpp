#include "patina/views/visibility.h"

#include <algorithm>
#include <atomic>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/base/random.h"
#include "patina/views/view_set.h"

namespace patina::views {

Triangle triangle_of(const render::Scene& scene, uint32_t primitive, uint32_t triangle) {
  const asset::Primitive& mesh = *scene.primitives()[primitive];
  const uvec3 corner = mesh.triangles[triangle];
  return {mesh.p_world[corner.x], mesh.p_world[corner.y], mesh.p_world[corner.z]};
}

std::optional<FrontHit> front_hit(const render::Scene& scene, const render::Ray& ray) {
  const std::optional<render::Hit> hit = scene.intersect(ray);
  if (!hit || static_cast<int>(hit->primitive) >= scene.num_asset_primitives()) return std::nullopt;
  const Triangle triangle = triangle_of(scene, hit->primitive, hit->triangle);
  const vec3 cross = triangle.cross();
  const float length = glm::length(cross);
  if (!(length > 0.0f)) return std::nullopt;  // a needle without a normal has no front
  FrontHit front{*hit, triangle.at(hit->barycentric), cross / length, 0.0f};
  front.cosine = -glm::dot(front.n_world, ray.direction);
  if (front.cosine < 0.0f) {
    const auto material = static_cast<size_t>(scene.primitives()[hit->primitive]->material);
    if (!scene.materials()[material].double_sided) return std::nullopt;
    front.n_world = -front.n_world;
    front.cosine = -front.cosine;
  }
  if (!(front.cosine > 0.0f)) return std::nullopt;
  return front;
}

bool unoccluded(const render::Scene& scene, const vec3& eye, const vec3& p_world) {
  const vec3 to_point = p_world - eye;
  const float distance = glm::length(to_point);
  if (!(distance > 0.0f)) return false;
  render::Ray ray{eye, to_point / distance};
  ray.t_max = distance * (1.0f - kVisibilityTolerance);
  return !scene.occluded(ray);
}

bool opaque_at(const render::Scene& scene, const vec3& eye, const vec3& p_world) {
  const vec3 to_point = p_world - eye;
  const float distance = glm::length(to_point);
  if (!(distance > 0.0f)) return false;
  render::Ray ray{eye, to_point / distance};
  ray.t_min = distance * (1.0f - kVisibilityTolerance);
  ray.t_max = distance * (1.0f + kVisibilityTolerance);
  return scene.occluded(ray);
}

std::optional<vec2> seen_at(const render::Scene& scene, const render::Camera& camera, const vec3& p_world,
                            const vec3& n_world) {
  const vec3 eye = camera.position();
  if (!(glm::dot(n_world, eye - p_world) > 0.0f)) return std::nullopt;
  const auto projection = camera.project(p_world);
  if (!projection) return std::nullopt;
  const vec2 pixel = projection->pixel;
  const bool inside = pixel.x >= 0.0f && pixel.y >= 0.0f && pixel.x < static_cast<float>(camera.width) &&
                      pixel.y < static_cast<float>(camera.height);
  if (!inside || !unoccluded(scene, eye, p_world)) return std::nullopt;
  return pixel;
}

// The area is cut into equal shares, one sample in each, at a random place of the triangle that holds the
// share's random point: stratified over the surface, so 2^16 samples settle a share to about 0.2 %.
float seen_share(const render::Scene& scene, std::span<const render::Camera> cameras, int min_views,
                 int material) {
  constexpr int64_t kNumSamples = 1 << 16;
  struct Place {
    uint32_t primitive, triangle;
  };
  std::vector<Place> places;
  std::vector<double> area_up_to;
  double area = 0;
  for (int primitive = 0; primitive < scene.num_asset_primitives(); ++primitive) {
    const asset::Primitive& mesh = *scene.primitives()[static_cast<size_t>(primitive)];
    if (material >= 0 && mesh.material != material) continue;
    for (size_t triangle = 0; triangle < mesh.triangles.size(); ++triangle) {
      const Place place{static_cast<uint32_t>(primitive), static_cast<uint32_t>(triangle)};
      area += triangle_of(scene, place.primitive, place.triangle).area();
      places.push_back(place);
      area_up_to.push_back(area);
    }
  }
  if (!(area > 0.0)) return 0.0f;

  std::atomic<int64_t> num_seen{0};
  parallel_for(0, kNumSamples, 1024, [&](int64_t begin, int64_t end) {
    int64_t seen = 0;
    for (int64_t sample = begin; sample < end; ++sample) {
      RandomStream random(0, RandomPurpose::kGBuffer, static_cast<uint64_t>(sample));
      const double at =
          area * (static_cast<double>(sample) + random.uniform()) / static_cast<double>(kNumSamples);
      const auto upper = std::upper_bound(area_up_to.begin(), area_up_to.end(), at);
      const auto index = std::min(static_cast<size_t>(upper - area_up_to.begin()), places.size() - 1);
      const Place place = places[index];
      const Triangle triangle = triangle_of(scene, place.primitive, place.triangle);
      vec2 barycentric = random.uniform2();
      if (barycentric.x + barycentric.y > 1.0f) barycentric = vec2(1.0f) - barycentric;
      const vec3 p_world = triangle.at(barycentric);
      vec3 n_world = triangle.cross();
      const int owner = scene.primitives()[place.primitive]->material;
      const asset::MaterialMaps& maps = scene.materials()[static_cast<size_t>(owner)];
      const bool double_sided = maps.double_sided;
      const bool see_through = maps.alpha_mode != asset::AlphaMode::kOpaque;
      int views = 0;
      for (const render::Camera& camera : cameras) {
        const vec3 n_seen =
            double_sided && glm::dot(n_world, camera.position() - p_world) < 0.0f ? -n_world : n_world;
        if (seen_at(scene, camera, p_world, n_seen) &&
            (!see_through || opaque_at(scene, camera.position(), p_world)))
          ++views;
        if (views >= min_views) break;
      }
      if (views >= min_views) ++seen;
    }
    num_seen += seen;
  });
  return static_cast<float>(static_cast<double>(num_seen.load()) / static_cast<double>(kNumSamples));
}

}  // namespace patina::views
