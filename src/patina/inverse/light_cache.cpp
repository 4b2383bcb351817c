#include "patina/inverse/light_cache.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/image/color.h"
#include "patina/inverse/light_bins.h"
#include "patina/inverse/light_packing.h"
#include "patina/render/microfacet.h"

namespace patina::inverse {
namespace {

constexpr int64_t kPixelsPerTask = 64;
// Pixels at most so far apart share their light.
constexpr int kShareRadius = 1;

// Where in its pixel trace `i` looks: the R2 sequence, an additive recurrence on the plastic constant,
// shifted by a random amount that belongs to the pixel, so that few traces cover the pixel evenly.
vec2 jitter(const vec2& shift, uint32_t i) {
  const double n = i;
  const double x = shift.x + n * 0.7548776662466927, y = shift.y + n * 0.5698402909980532;
  return {static_cast<float>(x - std::floor(x)), static_cast<float>(y - std::floor(y))};
}

// What was traced for one sample; punctual lights by themselves, since their directions are exact.
struct SampleLight {
  BinFrame frame;
  std::vector<PackedLight> entries;
  std::vector<IncidentLight> punctual;  // wi: weighted by luminance
  float num_hits = 0;
};

BinFrame frame_of(const CacheSample& sample, std::span<const asset::MaterialMaps> asset_materials) {
  const size_t material = sample.point.material;
  const Shading shading = shade_values(
      sample.point,
      material < asset_materials.size() ? sample_maps(asset_materials[material], sample.point) : sample.base);
  return bin_frame(shading.n_world, sample.point.wo,
                   square(render::alpha_from_roughness(shading.bsdf.roughness)) + sample.extent);
}

// The one of a pixel's samples that a traced surface belongs to: of its material, the one nearest in the
// texture. -1: none is of its material.
int sample_at(std::span<const CacheSample> samples, const render::SurfacePoint& surface, const vec3& wo,
              std::span<const asset::MaterialMaps> all_materials) {
  int nearest = -1;
  float least = std::numeric_limits<float>::infinity();
  for (size_t s = 0; s < samples.size(); ++s) {
    if (surface.material != samples[s].point.material) continue;
    if (samples.size() == 1) return 0;
    const size_t slot = index_of(asset::MapSlot::kBaseColor);
    const MaterialPoint point =
        material_point(surface, wo, all_materials[static_cast<size_t>(surface.material)]);
    const float distance = glm::length(point.uv[slot] - samples[s].point.uv[slot]);
    if (distance < least) least = distance, nearest = static_cast<int>(s);
  }
  return nearest;
}

// `lights`: of the pixel's `samples`.
void trace_pixel(std::span<SampleLight> lights, const CachePixel& pixel, std::span<const CacheSample> samples,
                 const render::Scene& scene, std::span<const asset::MaterialMaps> asset_materials,
                 const render::Camera& camera, const CacheOptions& options, LightGatherer& gatherer,
                 std::vector<IncidentLight>& entries) {
  if (samples.empty()) return;
  for (size_t s = 0; s < samples.size(); ++s) lights[s].frame = frame_of(samples[s], asset_materials);
  const uint64_t index = (uint64_t{pixel.view} << 32) | (uint64_t{pixel.y} << 16) | pixel.x;
  RandomStream pixel_random(options.seed, RandomPurpose::kLightCache, index, 0);
  const vec2 shift = pixel_random.uniform2();
  for (int i = 0; i < options.traces; ++i) {
    const auto trace = static_cast<uint32_t>(i);
    RandomStream random(options.seed, RandomPurpose::kLightCache, index, 1 + trace);
    const render::Ray ray = camera.ray(vec2(pixel.x, pixel.y) + jitter(shift, trace));
    const auto hit = scene.intersect(ray, random.uniform());
    if (!hit) continue;
    const render::SurfacePoint surface = scene.surface(ray, *hit, asset_materials);
    const int s = sample_at(samples, surface, -ray.direction, scene.materials());
    if (s < 0) continue;
    SampleLight& light = lights[static_cast<size_t>(s)];
    gatherer.gather(surface, -ray.direction, random, entries);
    for (size_t k = 0; k < entries.size(); ++k) {
      if (k < light.punctual.size()) {
        light.punctual[k].wi += luminance(entries[k].weighted_radiance) * entries[k].wi;
        light.punctual[k].weighted_radiance += entries[k].weighted_radiance;
      } else {
        if (max_component(entries[k].weighted_radiance) > 0.0f)
          light.entries.push_back(
              {pack_direction(entries[k].wi), pack_radiance(entries[k].weighted_radiance)});
      }
    }
    light.num_hits += 1;
  }
}

// Whether directions drawn for `other` also tell what falls on `own`: its lobe covers the other's, about.
bool share_light(const SampleLight& own, const SampleLight& other, const CacheSample& a,
                 const CacheSample& b) {
  return a.point.material == b.point.material && glm::dot(a.point.n_geometric, b.point.n_geometric) > 0.8f &&
         2.0f * (1.0f - glm::dot(own.frame.n, other.frame.n)) < 0.5f * own.frame.alpha2;
}

// The pixels of one view, found by their place.
class ViewPixels {
 public:
  ViewPixels(std::span<const CachePixel> pixels, size_t first, const views::View& view)
      : width_(view.gbuffer.width), height_(view.gbuffer.height) {
    at_.assign(static_cast<size_t>(width_) * static_cast<size_t>(height_), -1);
    for (size_t i = 0; i < pixels.size(); ++i)
      at_[static_cast<size_t>(pixels[i].y) * static_cast<size_t>(width_) + pixels[i].x] =
          static_cast<int64_t>(first + i);
  }
  /// -1 where no pixel counts.
  int64_t at(int x, int y) const {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return -1;
    return at_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  }

 private:
  int width_, height_;
  std::vector<int64_t> at_;
};

// Sums what was traced for sample `i` and those of the pixels around it into its lights. `lights`: of the
// view's samples, of which the first is `first`.
void gather_from_neighbours(LightCache& cache, size_t i, const ViewPixels& places,
                            std::span<const SampleLight> lights, size_t first) {
  const CacheSample& sample = cache.samples[i];
  const CachePixel& pixel = cache.pixels[sample.pixel];
  const SampleLight& own = lights[i - first];
  LightBins sum;
  float num_hits = 0;
  for (int dy = -kShareRadius; dy <= kShareRadius; ++dy)
    for (int dx = -kShareRadius; dx <= kShareRadius; ++dx) {
      const int64_t at = places.at(pixel.x + dx, pixel.y + dy);
      if (at < 0) continue;
      const auto near = static_cast<size_t>(at);
      for (size_t j = cache.first_sample[near]; j < cache.first_sample[near + 1]; ++j) {
        const SampleLight& light = lights[j - first];
        if (j != i && !share_light(own, light, sample, cache.samples[j])) continue;
        for (const PackedLight& entry : light.entries) {
          const IncidentLight arriving{unpack_direction(entry.direction), unpack_radiance(entry.radiance)};
          sum.add(own.frame, arriving);
        }
        num_hits += light.num_hits;
      }
    }
  PackedLight* out = cache.lights.data() + i * static_cast<size_t>(cache.lights_per_sample);
  const auto put = [&](const IncidentLight& light, float hits) {
    const vec3 radiance = hits > 0 ? light.weighted_radiance / hits : vec3(0.0f);
    *out++ = {pack_direction(glm::length(light.wi) > 0.0f ? light.wi : own.frame.n), pack_radiance(radiance)};
  };
  for (size_t bin = 0; bin < kNumBins; ++bin) put(sum.mean(bin, own.frame), num_hits);
  for (const IncidentLight& light : own.punctual) put(light, own.num_hits);
}

}  // namespace

size_t LightCache::bytes() const {
  return pixels.size() * sizeof(CachePixel) + samples.size() * sizeof(CacheSample) +
         lights.size() * sizeof(PackedLight);
}

std::vector<CachePixel> select_pixels(const views::ViewSet& views, std::span<const Image> targets,
                                      std::span<const Image> weights) {
  PATINA_CHECK_EQ(targets.size(), views.views.size());
  PATINA_CHECK_EQ(weights.size(), views.views.size());
  std::vector<CachePixel> pixels;
  for (size_t v = 0; v < weights.size(); ++v)
    for (int y = 0; y < weights[v].height; ++y)
      for (int x = 0; x < weights[v].width; ++x) {
        const float weight = *weights[v].at(x, y);
        if (weight > 0.0f)
          pixels.push_back({static_cast<uint16_t>(v), static_cast<uint16_t>(x), static_cast<uint16_t>(y),
                            weight, targets[v].rgb(x, y)});
      }
  return pixels;
}

void trace_light(LightCache& cache, const render::Scene& scene,
                 std::span<const asset::MaterialMaps> asset_materials, const views::ViewSet& views,
                 const CacheOptions& options, const Progress& progress) {
  PATINA_CHECK_EQ(cache.first_sample.size(), cache.pixels.size() + 1);
  const GatherOptions gather{options.light_samples, options.max_depth};
  const int num_entries = LightGatherer::num_entries(scene, gather);
  const auto num_punctual = static_cast<size_t>(num_entries - options.light_samples);
  cache.lights_per_sample = static_cast<int>(kNumBins + num_punctual);
  cache.lights.resize(cache.samples.size() * static_cast<size_t>(cache.lights_per_sample));

  // View by view, since the sums of a view's pixels take far more memory than what is kept of them.
  std::vector<SampleLight> lights;
  for (size_t first = 0; first < cache.pixels.size();) {
    const size_t v = cache.pixels[first].view;
    size_t last = first;
    while (last < cache.pixels.size() && cache.pixels[last].view == v) ++last;
    const size_t first_sample = cache.first_sample[first], last_sample = cache.first_sample[last];
    lights.assign(
        last_sample - first_sample,
        SampleLight{{}, {}, std::vector<IncidentLight>(num_punctual, {vec3(0.0f), vec3(0.0f)}), 0.0f});
    parallel_for(static_cast<int64_t>(first), static_cast<int64_t>(last), kPixelsPerTask,
                 [&](int64_t begin, int64_t end) {
                   progress.throw_if_stopped();
                   LightGatherer gatherer(scene, asset_materials, gather);
                   std::vector<IncidentLight> entries(static_cast<size_t>(num_entries));
                   for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
                     trace_pixel(std::span(lights).subspan(cache.first_sample[i] - first_sample,
                                                           cache.samples_of(i).size()),
                                 cache.pixels[i], cache.samples_of(i), scene, asset_materials,
                                 views.views[v].camera, options, gatherer, entries);
                 });
    const ViewPixels places(std::span(cache.pixels).subspan(first, last - first), first, views.views[v]);
    parallel_for(static_cast<int64_t>(first_sample), static_cast<int64_t>(last_sample), kPixelsPerTask,
                 [&](int64_t begin, int64_t end) {
                   for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
                     gather_from_neighbours(cache, i, places, lights, first_sample);
                 });
    first = last;
  }
}

}  // namespace patina::inverse
