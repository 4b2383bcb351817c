// What only holds on average: images and gradients of the light cache and of path replay against the path
// tracer, by z-tests.
#include <cmath>

#include <gtest/gtest.h>

#include "patina/inverse/path_replay.h"
#include "patina/inverse/shade.h"
#include "worlds.h"

namespace patina::test {
namespace {

using asset::MapSlot;

struct Moments {
  double sum = 0, squares = 0;
  int count = 0;
  void add(double x) { sum += x, squares += x * x, ++count; }
  double mean() const { return sum / count; }
  double variance_of_mean() const { return std::max(0.0, squares / count - mean() * mean()) / (count - 1); }
};
// Four standard errors: with a few dozen comparisons a false alarm has odds of about one in 500, and seeds
// are fixed.
constexpr double kMaxZ = 4.0;
// What the light of neighbours and one shading a pixel may add to or take from the cache's means.
constexpr double kMaxBias = 0.01;
// The same for derivatives, over the radiance: a bin is exact for the roughness and the normal that it was
// traced with, but not how it changes with them.
constexpr double kMaxGradientBias = 0.03;

double z_of(const Moments& a, const Moments& b) {
  return (a.mean() - b.mean()) / std::sqrt(a.variance_of_mean() + b.variance_of_mean() + 1e-20);
}

// By how much two means differ beyond what noise explains.
double excess(const Moments& a, const Moments& b) {
  const double noise = kMaxZ * std::sqrt(a.variance_of_mean() + b.variance_of_mean());
  return std::max(0.0, std::abs(a.mean() - b.mean()) - noise);
}

constexpr int kResolution = 32;

vec3 sum_over_pixels(const inverse::LightCache& cache, render::BsdfModel model) {
  vec3 sum(0.0f);
  for (size_t s = 0; s < cache.samples.size(); ++s) {
    const auto& sample = cache.samples[s];
    const auto shading = inverse::shade_values(sample.point, sample.base);
    sum += sample.share * inverse::Shader(model).shade(sample, shading, cache.lights_of(s));
  }
  return sum;
}

TEST(light_cache, image_agrees_with_the_path_tracer) {
  for (const Lighting lighting : kAllLighting)
    for (const int depth : {1, 3}) {
      const World world = make_world(lighting, 8, kResolution);
      const views::ViewSet views = view_of(world);
      const auto pixels = all_pixels(views);
      Moments cached, traced;
      for (uint32_t generation = 0; generation < 12; ++generation) {
        inverse::CacheOptions options;
        options.max_depth = depth;
        options.seed = generation;
        const auto cache = traced_cache(world, views, options);
        cached.add(luminance(sum_over_pixels(cache, world.scene.bsdf_model())));

        render::PathOptions path;
        path.max_depth = depth;
        path.samples_per_pixel = 32;
        path.seed = generation;
        const render::Render render = render::render(world.scene, world.camera, path);
        vec3 sum(0.0f);
        for (const auto& pixel : pixels) sum += render.radiance.rgb(pixel.x, pixel.y);
        traced.add(luminance(sum));
      }
      EXPECT_LT(excess(cached, traced), kMaxBias * traced.mean())
          << name_of(lighting) << " depth " << depth << ": " << cached.mean() << " against " << traced.mean();
      EXPECT_LT(std::sqrt(traced.variance_of_mean()) / traced.mean(), 0.02) << "too noisy to tell anything";
    }
}

TEST(path_replay, radiance_agrees_with_the_path_tracer) {
  for (const Lighting lighting : kAllLighting) {
    const World world = make_world(lighting, 8, kResolution);
    render::PathOptions path;
    path.max_depth = 4;
    Moments recorded, traced;
    for (uint32_t repeat = 0; repeat < 12; ++repeat) {
      vec3 a(0.0f), b(0.0f);
      for (int i = 0; i < 16 * kResolution * kResolution; ++i) {
        const vec2 position(static_cast<float>(i % kResolution) + 0.5f,
                            static_cast<float>(i / kResolution % kResolution) + 0.5f);
        RandomStream first(1, RandomPurpose::kTest, static_cast<uint64_t>(i), repeat);
        RandomStream second(2, RandomPurpose::kTest, static_cast<uint64_t>(i), repeat);
        const auto record = inverse::record_path(world.scene, world.camera.ray(position), path, first);
        a += inverse::path_radiance(record, world.maps, world.scene.bsdf_model());
        b += render::trace_path(world.scene, world.camera.ray(position), path, second);
      }
      recorded.add(luminance(a));
      traced.add(luminance(b));
    }
    EXPECT_LT(std::abs(z_of(recorded, traced)), kMaxZ) << name_of(lighting);
  }
}

// The cache holds incident light fixed, so its gradient is the whole gradient for direct light.
TEST(light_cache, gradient_agrees_with_path_replay) {
  for (const Lighting lighting : kAllLighting) {
    const World world = make_world(lighting, 1, kResolution);
    const views::ViewSet views = view_of(world);
    const auto pixels = all_pixels(views);
    const int num_materials = static_cast<int>(world.maps.size());
    std::array<Moments, 2 * 6> cached, replayed;
    Moments radiance;  // of all pixels and channels
    const auto add = [](std::array<Moments, 2 * 6>& moments, const inverse::TexelGradients& gradients) {
      for (size_t m = 0; m < 2; ++m) {
        const auto& slots = gradients.slots[m];
        moments[6 * m].add(slots[0].pixels[0]);
        moments[6 * m + 1].add(slots[0].pixels[2]);
        moments[6 * m + 2].add(slots[index_of(MapSlot::kRoughness)].pixels[0]);
        moments[6 * m + 3].add(slots[index_of(MapSlot::kMetallic)].pixels[0]);
        moments[6 * m + 4].add(slots[index_of(MapSlot::kNormal)].pixels[0]);
        moments[6 * m + 5].add(slots[index_of(MapSlot::kNormal)].pixels[1]);
      }
    };
    for (uint32_t generation = 0; generation < 12; ++generation) {
      inverse::CacheOptions options;
      options.max_depth = 1;
      options.seed = generation;
      const auto cache = traced_cache(world, views, options);
      auto from_cache = inverse::zero_gradients(world.maps, num_materials);
      double sum = 0;
      for (size_t s = 0; s < cache.samples.size(); ++s) {
        const auto& sample = cache.samples[s];
        if (sample.point.material > 1) continue;
        const auto shading = inverse::shade_values(sample.point, sample.base);
        inverse::Shader shader(world.scene.bsdf_model());
        const vec3 reflected = shader.shade(sample, shading, cache.lights_of(s));
        sum += sample.share * (reflected.r + reflected.g + reflected.b);
        inverse::splat(from_cache, world.maps[sample.point.material], sample.point,
                       shader.adjoint(vec3(sample.share)));
      }
      add(cached, from_cache);
      radiance.add(sum);

      auto from_paths = inverse::zero_gradients(world.maps, num_materials);
      render::PathOptions path;
      path.max_depth = 1;
      constexpr int kPaths = 32;
      for (const auto& pixel : pixels)
        for (uint32_t k = 0; k < kPaths; ++k) {
          RandomStream random(5, RandomPurpose::kTest, static_cast<uint64_t>(pixel.y) * 64 + pixel.x,
                              generation * kPaths + k);
          const auto ray = world.camera.ray(vec2(pixel.x, pixel.y) + random.uniform2());
          inverse::add_path_gradient(inverse::record_path(world.scene, ray, path, random), world.maps,
                                     world.scene.bsdf_model(), vec3(1.0f / kPaths), from_paths);
        }
      add(replayed, from_paths);
    }
    for (size_t i = 0; i < cached.size(); ++i)
      EXPECT_LT(excess(cached[i], replayed[i]), kMaxGradientBias * radiance.mean())
          << name_of(lighting) << ", component " << i << ": " << cached[i].mean() << " against "
          << replayed[i].mean() << ", radiance " << radiance.mean();
  }
}

}  // namespace
}  // namespace patina::test
