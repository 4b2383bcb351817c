#include "patina/views/visibility.h"

#include <algorithm>
#include <atomic>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/base/random.h"
#include "patina/render/triangle.h"
#include "patina/views/view_set.h"

namespace patina::views {

std::optional<FrontHit> front_hit(const render::Scene& scene, const render::Ray& ray) {
  const std::optional<render::Hit> hit = scene.intersect(ray);
  if (!hit || static_cast<int>(hit->primitive) >= scene.num_asset_primitives()) return std::nullopt;
  const render::Triangle triangle = render::triangle_of(*scene.primitives()[hit->primitive], hit->triangle);
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

namespace {

// Points of the asset's surface, of one material or (negative) all: the area is cut into equal shares, one
// point in each, at a random place of the triangle that holds the share's random point. Stratified over the
// surface, 2^16 points settle a share to about 0.2 %.
class SurfacePoints {
 public:
  static constexpr int64_t kCount = 1 << 16;

  SurfacePoints(const render::Scene& scene, int material) : scene_(scene) {
    for (int primitive = 0; primitive < scene.num_asset_primitives(); ++primitive) {
      const asset::Primitive& mesh = *scene.primitives()[static_cast<size_t>(primitive)];
      if (material >= 0 && mesh.material != material) continue;
      for (size_t triangle = 0; triangle < mesh.triangles.size(); ++triangle) {
        const Place place{static_cast<uint32_t>(primitive), static_cast<uint32_t>(triangle)};
        area_ += render::triangle_of(*scene.primitives()[place.primitive], place.triangle).area();
        places_.push_back(place);
        area_up_to_.push_back(area_);
      }
    }
  }
  bool empty() const { return !(area_ > 0.0); }

  struct Point {
    vec3 p_world;
    vec3 n_world;  // not unit
    bool double_sided, see_through;
  };
  Point operator[](int64_t index) const {
    RandomStream random(0, RandomPurpose::kGBuffer, static_cast<uint64_t>(index));
    const double at = area_ * (static_cast<double>(index) + random.uniform()) / static_cast<double>(kCount);
    const auto upper = std::upper_bound(area_up_to_.begin(), area_up_to_.end(), at);
    const Place place =
        places_[std::min(static_cast<size_t>(upper - area_up_to_.begin()), places_.size() - 1)];
    const render::Triangle triangle =
        render::triangle_of(*scene_.primitives()[place.primitive], place.triangle);
    vec2 barycentric = random.uniform2();
    if (barycentric.x + barycentric.y > 1.0f) barycentric = vec2(1.0f) - barycentric;
    const int owner = scene_.primitives()[place.primitive]->material;
    const asset::MaterialMaps& maps = scene_.materials()[static_cast<size_t>(owner)];
    return {triangle.at(barycentric), triangle.cross(), maps.double_sided,
            maps.alpha_mode != asset::AlphaMode::kOpaque};
  }

 private:
  struct Place {
    uint32_t primitive, triangle;
  };
  const render::Scene& scene_;
  std::vector<Place> places_;
  std::vector<double> area_up_to_;
  double area_ = 0;
};

bool is_seen(const render::Scene& scene, const render::Camera& camera, const SurfacePoints::Point& point) {
  const vec3 to_eye = camera.position() - point.p_world;
  const vec3 n_seen =
      point.double_sided && glm::dot(point.n_world, to_eye) < 0.0f ? -point.n_world : point.n_world;
  return seen_at(scene, camera, point.p_world, n_seen) &&
         (!point.see_through || opaque_at(scene, camera.position(), point.p_world));
}

}  // namespace

float seen_share(const render::Scene& scene, std::span<const render::Camera> cameras, int min_views,
                 int material) {
  const SurfacePoints points(scene, material);
  if (points.empty()) return 0.0f;
  std::atomic<int64_t> num_seen{0};
  parallel_for(0, SurfacePoints::kCount, 1024, [&](int64_t begin, int64_t end) {
    int64_t seen = 0;
    for (int64_t i = begin; i < end; ++i) {
      const SurfacePoints::Point point = points[i];
      int views = 0;
      for (const render::Camera& camera : cameras) {
        if (is_seen(scene, camera, point)) ++views;
        if (views >= min_views) break;
      }
      if (views >= min_views) ++seen;
    }
    num_seen += seen;
  });
  return static_cast<float>(static_cast<double>(num_seen.load()) /
                            static_cast<double>(SurfacePoints::kCount));
}

UnseenCauses unseen_causes(const render::Scene& scene, std::span<const render::Camera> cameras) {
  const SurfacePoints points(scene, -1);
  if (points.empty()) return {};
  std::atomic<int64_t> turned_away{0}, transparent{0};
  parallel_for(0, SurfacePoints::kCount, 1024, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const SurfacePoints::Point point = points[i];
      const auto any = [&](const auto& test) { return std::any_of(cameras.begin(), cameras.end(), test); };
      if (any([&](const render::Camera& camera) { return is_seen(scene, camera, point); })) continue;
      if (any([&](const render::Camera& camera) {
            return seen_at(scene, camera, point.p_world, point.n_world).has_value();
          }))
        ++transparent;  // it was not seen, so no ray stops there
      else if (any([&](const render::Camera& camera) {
                 return seen_at(scene, camera, point.p_world, -point.n_world).has_value();
               }))
        ++turned_away;
    }
  });
  const auto share = [](int64_t count) {
    return static_cast<float>(static_cast<double>(count) / static_cast<double>(SurfacePoints::kCount));
  };
  return {share(turned_away), share(transparent)};
}

UnseenSurface unseen_surface(const render::Scene& scene, std::span<const render::Camera> cameras) {
  const SurfacePoints points(scene, -1);
  if (points.empty()) return {};
  constexpr float kSteep = 0.70710678f;  // sine of 45 degrees
  std::atomic<int64_t> down{0}, up{0}, sideways{0};
  parallel_for(0, SurfacePoints::kCount, 1024, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const SurfacePoints::Point point = points[i];
      if (std::any_of(cameras.begin(), cameras.end(),
                      [&](const render::Camera& camera) { return is_seen(scene, camera, point); }))
        continue;
      const float height = point.n_world.y / glm::length(point.n_world);
      ++(height < -kSteep ? down : height > kSteep ? up : sideways);
    }
  });
  const auto share = [](const std::atomic<int64_t>& count) {
    return static_cast<float>(static_cast<double>(count.load()) / static_cast<double>(SurfacePoints::kCount));
  };
  return {share(down), share(up), share(sideways)};
}

}  // namespace patina::views
