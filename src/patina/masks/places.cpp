#include "patina/masks/places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "patina/asset/texel_raster.h"
#include "patina/base/parallel.h"
#include "patina/base/random.h"
#include "patina/masks/padding.h"
#include "patina/masks/surface_shape.h"
#include "patina/render/triangle.h"
#include "patina/views/strength_views.h"

namespace patina::masks {
namespace {

// Lengths as shares of the asset's radius.
constexpr float kEdgeWidth = 0.04f, kCavityDepth = 0.5f, kStreakLength = 0.6f, kStreakWidth = 0.03f,
                kStreakStep = 0.02f;
constexpr uint64_t kSeed = 0;  // masks do not depend on the run's seed: a repainted one stays right

// The point of the surface that a texel shows.
struct SurfaceTexel {
  size_t texel = 0;
  render::Hit hit;
};

std::vector<SurfaceTexel> surface_of(const render::Scene& scene, const asset::Map& map, int material) {
  std::vector<SurfaceTexel> all(map.texels.num_pixels());
  std::vector<bool> seen(all.size());
  asset::each_touched_texel(
      views::asset_primitives(scene), map, material, [&](const asset::TouchedTexel& touched) {
        if (seen[touched.texel] && !touched.inside) return;
        all[touched.texel] = {touched.texel,
                              {.primitive = touched.primitive_index,
                               .triangle = touched.triangle,
                               .barycentric = {touched.barycentric.y, touched.barycentric.z}}};
        seen[touched.texel] = true;
      });
  std::erase_if(all, [&, i = size_t{0}](const SurfaceTexel&) mutable { return !seen[i++]; });
  return all;
}

// The point of a hit as a ray from its front meets it.
render::SurfacePoint front_of(const render::Scene& scene, const render::Hit& hit) {
  const vec3 cross = render::triangle_of(*scene.primitives()[hit.primitive], hit.triangle).cross();
  const float length = glm::length(cross);
  render::Ray ray;
  ray.direction = length > 0.0f ? -cross / length : vec3(0, -1, 0);
  return scene.surface(ray, hit);
}

// Smooth noise in [0,1] over a horizontal plane, one random value a unit cell.
float cell_noise(const vec2& at) {
  const vec2 low = glm::floor(at);
  const vec2 t = at - low;
  const vec2 s = t * t * (3.0f - 2.0f * t);
  const auto value = [&](int dx, int dy) {
    const auto x = static_cast<uint32_t>(static_cast<int>(low.x) + dx),
               y = static_cast<uint32_t>(static_cast<int>(low.y) + dy);
    return RandomStream(kSeed, RandomPurpose::kMasks, static_cast<uint64_t>(x) << 32 | y, 1).uniform();
  };
  return glm::mix(glm::mix(value(0, 0), value(1, 0), s.x), glm::mix(value(0, 1), value(1, 1), s.x), s.y);
}

constexpr float kFlat = 0.8f;  // height of a normal of surface on which water rests

// The point of the surface `step` metres up its slope; nothing where it ends, turns flat or is closed off.
std::optional<render::SurfacePoint> step_up(const render::Scene& scene, const render::SurfacePoint& point,
                                            float step) {
  const vec3 n = point.n_geometric;
  render::Ray ray;
  ray.origin = point.p_world + step * (glm::normalize(vec3(0, 1, 0) - n.y * n) + n);
  ray.direction = -n;
  ray.t_max = 2.0f * step;
  const auto hit = scene.intersect(ray);
  if (!hit || static_cast<int>(hit->primitive) >= scene.num_asset_primitives()) return std::nullopt;
  const render::SurfacePoint next = scene.surface(ray, *hit);
  if (next.n_geometric.y > kFlat || glm::dot(next.n_geometric, n) < 0.2f) return std::nullopt;
  return next;
}

// Walks up the surface as far as it goes. Whether and how strongly a streak runs down from there is up to the
// place where the walk ends, so that all points below it agree: steps get shorter there, to find that place.
float drip_at(const render::Scene& scene, render::SurfacePoint point, float radius) {
  if (std::abs(point.n_geometric.y) > kFlat) return 0.0f;
  float walked = 0, step = kStreakStep * radius;
  const float shortest = step / 32.0f;
  while (walked < kStreakLength * radius && step > shortest) {
    if (const auto next = step_up(scene, point, step)) {
      point = *next;
      walked += step;
    } else {
      step /= 2.0f;
    }
  }
  const vec2 source = vec2(point.p_world.x, point.p_world.z) / (kStreakWidth * radius);
  const float length = kStreakLength * radius * cell_noise(source + vec2(1000.0f));
  if (!(walked < length)) return 0.0f;
  return glm::smoothstep(0.45f, 0.75f, cell_noise(source)) * (1.0f - walked / length);
}

// Rays are few, so what they say is noisy from texel to texel, and smoothed before it is judged.
bool is_noisy(Place place) {
  return place == Place::kEdges || place == Place::kCrevices || place == Place::kCavities;
}

float strength_of(Place place, float measured) {
  switch (place) {
    case Place::kEdges:
    case Place::kCrevices:
      return glm::smoothstep(0.15f, 0.6f, measured);
    case Place::kCavities:
      return glm::smoothstep(0.2f, 0.8f, measured);
    case Place::kUp:
    case Place::kDown:
      return glm::smoothstep(0.1f, 0.8f, measured);
    case Place::kDrips:
      break;
  }
  return measured;
}

float measured_at(const render::Scene& scene, const SurfaceTexel& texel, Place place, float radius) {
  const render::SurfacePoint point = front_of(scene, texel.hit);
  const ShapeRays rays{.count = 64, .seed = kSeed, .index = texel.texel};
  const float width = kEdgeWidth * radius;
  switch (place) {
    case Place::kEdges:
      return bends_away(scene, point, width, rays) +
             std::max(0.0f, relief(scene, texel.hit, point, 0.5f * width));
    case Place::kCrevices:
      return 2.0f * closed_in(scene, point, width, rays) +
             std::max(0.0f, -relief(scene, texel.hit, point, 0.5f * width));
    case Place::kCavities:
      return closed_in(scene, point, kCavityDepth * radius, rays);
    case Place::kUp:
      return point.n_shading.y;
    case Place::kDown:
      return -point.n_shading.y;
    case Place::kDrips:
      break;
  }
  return drip_at(scene, point, radius);
}

// Binomial mean over three texels along x or y, of those that lie on the surface.
Image smoothed(const Image& values, const Image& covered, ivec2 axis) {
  constexpr std::array<float, 3> kWeights{1, 2, 1};
  Image out = values;
  for (int y = 0; y < values.height; ++y)
    for (int x = 0; x < values.width; ++x) {
      if (*covered.at(x, y) <= 0.0f) continue;
      float sum = 0, weight = 0;
      for (int k = 0; k < 3; ++k) {
        const int u = x + (k - 1) * axis.x, v = y + (k - 1) * axis.y;
        if (u < 0 || v < 0 || u >= values.width || v >= values.height) continue;
        const float w = kWeights[static_cast<size_t>(k)] * *covered.at(u, v);
        sum += w * *values.at(u, v), weight += w;
      }
      *out.at(x, y) = sum / weight;
    }
  return out;
}

}  // namespace

asset::Map place_strength(const render::Scene& scene, const asset::Map& like, int width, int height,
                          int material, std::span<const PlaceAmount> places, const Progress& progress) {
  asset::Map map = asset::blank_map(like, width, height);
  const std::vector<SurfaceTexel> surface = surface_of(scene, map, material);
  vec3 low(std::numeric_limits<float>::infinity()), high(-low);
  for (const asset::Primitive* primitive : views::asset_primitives(scene))
    for (const vec3& p : primitive->p_world) low = glm::min(low, p), high = glm::max(high, p);
  const float radius = 0.5f * glm::length(high - low);
  Image covered(width, height, 1);
  for (const SurfaceTexel& texel : surface) covered.pixels[texel.texel] = 1.0f;
  constexpr int64_t kTexelsAtOnce = 1 << 14;
  const auto count = static_cast<int64_t>(surface.size());
  const double total = static_cast<double>(count) * static_cast<double>(places.size());
  for (size_t p = 0; p < places.size(); ++p) {
    Image measured(width, height, 1);
    for (int64_t first = 0; first < count; first += kTexelsAtOnce) {
      progress.throw_if_stopped();
      const int64_t last = std::min(count, first + kTexelsAtOnce);
      parallel_for(first, last, 64, [&](int64_t begin, int64_t end) {
        for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
          measured.pixels[surface[i].texel] = measured_at(scene, surface[i], places[p].place, radius);
      });
      progress.update("masks", static_cast<double>(static_cast<int64_t>(p) * count + last), total);
    }
    if (is_noisy(places[p].place)) measured = smoothed(smoothed(measured, covered, {1, 0}), covered, {0, 1});
    for (const SurfaceTexel& texel : surface) {
      float& value = map.texels.pixels[texel.texel];
      value = std::max(value, places[p].amount * strength_of(places[p].place, measured.pixels[texel.texel]));
    }
  }
  map.texels = asset::dilated(map, covered, kPaddingTexels);
  return map;
}

}  // namespace patina::masks
