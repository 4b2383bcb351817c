#include "patina/inverse/light_cache.h"

#include <array>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/inverse/light_packing.h"

namespace patina::inverse {
namespace {

// Where in its pixel generation `g` looks: the R2 sequence, an additive recurrence on the plastic constant,
// shifted by a random amount that belongs to the pixel, so that few generations cover the pixel evenly.
vec2 jitter(const vec2& shift, uint32_t generation) {
  const double n = generation;
  const double x = shift.x + n * 0.7548776662466927, y = shift.y + n * 0.5698402909980532;
  return {static_cast<float>(x - std::floor(x)), static_cast<float>(y - std::floor(y))};
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

void trace_cache(LightCache& cache, const render::Scene& scene,
                 std::span<const asset::MaterialMaps> asset_materials,
                 std::span<const asset::MaterialMaps> base_maps, const views::ViewSet& views,
                 const CacheOptions& options, const Progress& progress) {
  const GatherOptions gather{options.light_samples, options.max_depth};
  cache.lights_per_pixel = LightGatherer::num_entries(scene, gather);
  cache.samples.resize(cache.pixels.size());
  cache.lights.resize(cache.pixels.size() * static_cast<size_t>(cache.lights_per_pixel));

  constexpr int64_t kPixelsPerTask = 64;
  parallel_for(0, static_cast<int64_t>(cache.pixels.size()), kPixelsPerTask, [&](int64_t begin, int64_t end) {
    progress.throw_if_stopped();
    LightGatherer gatherer(scene, asset_materials, gather);
    std::vector<IncidentLight> lights(static_cast<size_t>(cache.lights_per_pixel));
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const CachePixel& pixel = cache.pixels[i];
      const render::Camera& camera = views.views[pixel.view].camera;
      const uint64_t index = (uint64_t{pixel.view} << 32) | (uint64_t{pixel.y} << 16) | pixel.x;
      RandomStream pixel_random(options.seed, RandomPurpose::kLightCache, index, 0);
      const vec2 shift = pixel_random.uniform2();
      RandomStream random(options.seed, RandomPurpose::kLightCache, index, 1 + options.generation);
      const render::Ray ray = camera.ray(vec2(pixel.x, pixel.y) + jitter(shift, options.generation));
      const auto hit = scene.intersect(ray, random.uniform());
      CacheSample& sample = cache.samples[i];
      sample.hit = hit.has_value();
      if (!hit) continue;
      const render::SurfacePoint surface = scene.surface(ray, *hit, asset_materials);
      const auto material = static_cast<size_t>(surface.material);
      const bool is_context = material >= base_maps.size();
      const asset::MaterialMaps& base = is_context ? scene.materials()[material] : base_maps[material];
      sample.point = material_point(surface, -ray.direction, base);
      sample.base = sample_maps(base, sample.point);
      sample.emission = surface.emission;
      gatherer.gather(surface, -ray.direction, random, lights);
      PackedLight* packed = cache.lights.data() + i * lights.size();
      for (const IncidentLight& light : lights)
        *packed++ = {pack_direction(light.wi), pack_radiance(light.weighted_radiance)};
    }
  });
}

}  // namespace patina::inverse
