#include "patina/inverse/seen_points.h"

#include <algorithm>
#include <cmath>

#include "patina/base/parallel.h"

namespace patina::inverse {
namespace {

constexpr int kSide = 2;
constexpr size_t kPoints = kSide * kSide;

// A point and what the starting maps are worth there.
struct Seen {
  MapValues values;
  vec3 n;  // shading normal in world space
};

// Whether the mean of two points reflects about what they do together.
bool is_alike(const SeenPoint& a, const Seen& of_a, const SeenPoint& b, const Seen& of_b) {
  constexpr float kMaxDifference = 0.3f, kMinCosine = 0.9f;
  return a.point.material == b.point.material &&
         std::abs(of_a.values.metallic - of_b.values.metallic) < kMaxDifference &&
         std::abs(of_a.values.roughness - of_b.values.roughness) < kMaxDifference &&
         glm::dot(of_a.n, of_b.n) > kMinCosine;
}

// The surface halfway between `points`, with the UVs of the first: the others may lie across a seam.
MaterialPoint mean_point(std::span<const SeenPoint> points) {
  MaterialPoint mean = points[0].point;
  for (const SeenPoint& seen : points.subspan(1)) {
    const MaterialPoint& point = seen.point;
    mean.vertex_color += point.vertex_color;
    mean.tangent += point.tangent, mean.bitangent += point.bitangent;
    mean.n_interpolated += point.n_interpolated, mean.n_geometric += point.n_geometric;
    mean.wo += point.wo;
  }
  const float share = 1.0f / static_cast<float>(points.size());
  mean.vertex_color *= share, mean.tangent *= share, mean.bitangent *= share;
  for (vec3* direction : {&mean.n_interpolated, &mean.n_geometric, &mean.wo})
    *direction = glm::normalize(*direction);
  return mean;
}

// The sample of `points`, which are alike. `seen`: of each point.
CacheSample sample_of(std::span<const SeenPoint> points, std::span<const Seen> seen, size_t num_in_pixel) {
  const auto count = static_cast<float>(points.size());
  CacheSample sample;
  sample.pixel = points[0].pixel;
  sample.share = count / static_cast<float>(num_in_pixel);
  sample.point = mean_point(points);
  MapValues sum = zero_gradient();
  float turned = 0;
  for (size_t k = 0; k < points.size(); ++k) {
    const MapValues& values = seen[k].values;
    sum.base_color += values.base_color, sum.normal += values.normal;
    sum.roughness += values.roughness, sum.metallic += values.metallic;
    const vec3 turn = points[k].point.n_interpolated - sample.point.n_interpolated;
    turned += glm::dot(turn, turn);
    sample.emission += points[k].emission / count;
  }
  sample.base = {sum.base_color / count, sum.roughness / count, sum.metallic / count, sum.normal / count};
  // Of points about their mean instead of about one of them: half as much on average. A disc of radius r has
  // a mean square of r²/2.
  sample.extent = std::min(turned / count, 0.2f);
  return sample;
}

}  // namespace

std::vector<SeenPoint> trace_seen_points(const render::Scene& scene, const views::ViewSet& views,
                                         std::span<const CachePixel> pixels) {
  std::vector<SeenPoint> points(pixels.size() * kPoints);
  parallel_for(0, static_cast<int64_t>(pixels.size()), 256, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
      for (size_t k = 0; k < kPoints; ++k) {
        const CachePixel& pixel = pixels[i];
        const vec2 position(static_cast<float>(pixel.x) + (static_cast<float>(k % kSide) + 0.5f) / kSide,
                            static_cast<float>(pixel.y) + (static_cast<float>(k / kSide) + 0.5f) / kSide);
        const render::Ray ray = views.views[pixel.view].camera.ray(position);
        const auto hit = scene.intersect(ray);
        if (!hit) continue;
        const render::SurfacePoint surface = scene.surface(ray, *hit);
        points[i * kPoints + k] = {
            material_point(surface, -ray.direction, scene.materials()[static_cast<size_t>(surface.material)]),
            surface.emission, pixel.weight / kPoints, static_cast<uint32_t>(i)};
      }
  });
  std::erase_if(points, [](const SeenPoint& seen) { return seen.weight <= 0.0f; });
  return points;
}

void make_samples(LightCache& cache, const render::Scene& scene,
                  std::span<const asset::MaterialMaps> base_maps, std::vector<SeenPoint>& points) {
  cache.samples.clear();
  cache.first_sample.assign(1, 0);
  auto next = points.begin();
  for (uint32_t pixel = 0; pixel < cache.pixels.size(); ++pixel) {
    const auto first = next;
    while (next != points.end() && next->pixel == pixel) ++next;
    const auto num_in_pixel = static_cast<size_t>(next - first);
    for (auto begin = first; begin != next;) {
      std::array<Seen, kPoints> seen;
      const auto of = [&](const SeenPoint& point) {
        const size_t material = point.point.material;
        const MapValues values = sample_maps(
            material < base_maps.size() ? base_maps[material] : scene.materials()[material], point.point);
        return Seen{values, shade_values(point.point, values).n_world};
      };
      const SeenPoint representative = *begin;
      const Seen its = of(representative);
      const auto end = std::stable_partition(begin, next, [&](const SeenPoint& point) {
        return is_alike(representative, its, point, of(point));
      });
      for (auto point = begin; point != end; ++point) {
        seen[static_cast<size_t>(point - begin)] = of(*point);
        point->sample = static_cast<uint32_t>(cache.samples.size());
      }
      cache.samples.push_back(sample_of({begin, end}, seen, num_in_pixel));
      begin = end;
    }
    cache.first_sample.push_back(static_cast<uint32_t>(cache.samples.size()));
  }
}

}  // namespace patina::inverse
