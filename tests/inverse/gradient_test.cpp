// Gradients of the path replay and of the light cache against central differences, over parameter × lighting
// × depth × texture filter. Sampling is held fixed (common random numbers), so the functions are smooth and
// the comparison is tight.
#include <cmath>

#include <gtest/gtest.h>

#include "patina/base/random.h"
#include "patina/inverse/path_replay.h"
#include "patina/inverse/shade.h"
#include "worlds.h"

namespace patina::test {
namespace {

using inverse::Slot;

struct Parameter {
  const char* name;
  Slot slot;
  int channel;  // -1: all
};
constexpr Parameter kParameters[] = {{"base colour", Slot::kBaseColor, -1},
                                     {"roughness", Slot::kRoughness, -1},
                                     {"metallic", Slot::kMetallic, -1},
                                     {"normal x", Slot::kNormal, 0},
                                     {"normal y", Slot::kNormal, 1}};

// A fixed random direction in the space of one parameter's texels; material by material.
using Direction = std::vector<std::vector<float>>;
Direction direction_of(const std::vector<asset::MaterialMaps>& maps, const Parameter& parameter) {
  Direction direction;
  for (size_t m = 0; m < maps.size(); ++m) {
    const Image& texels = inverse::slot_map(maps[m], parameter.slot).texels;
    RandomStream random(11, RandomPurpose::kTest, m);
    auto& values = direction.emplace_back(texels.pixels.size());
    for (size_t i = 0; i < values.size(); ++i) {
      const bool moves = parameter.channel < 0 || static_cast<int>(i) % texels.channels == parameter.channel;
      values[i] = moves ? 0.5f + random.uniform() : 0.0f;
    }
  }
  return direction;
}
std::vector<asset::MaterialMaps> moved(std::vector<asset::MaterialMaps> maps, const Parameter& parameter,
                                       const Direction& direction, float step) {
  for (size_t m = 0; m < maps.size(); ++m) {
    Image& texels = inverse::slot_map(maps[m], parameter.slot).texels;
    for (size_t i = 0; i < texels.pixels.size(); ++i) texels.pixels[i] += step * direction[m][i];
  }
  return maps;
}

// Central differences with steps h and h/2, extrapolated [Richardson]; their disagreement bounds what the
// check can see.
template <class Function>
double derivative(const Function& f, float h) {
  const double coarse = (f(h) - f(-h)) / (2.0 * h);
  const double fine = (f(0.5f * h) - f(-0.5f * h)) / h;
  return (4.0 * fine - coarse) / 3.0;
}

// A normal's step is smaller: within it no light may cross the horizon of a shading normal, where the
// derivative jumps.
float step_of(const Parameter& parameter) {
  return parameter.slot == Slot::kNormal ? 1e-3f : 1e-2f;
}
// Values are sums of single-precision paths: 1e-7 of the sum over a step, and what the fourth-order
// difference leaves.
constexpr double kRelativeError = 5e-3;

// Where a normal had to be turned toward the viewer its map gets no gradient by design: such paths are left
// out.
bool has_free_normals(const inverse::PathRecord& path, const std::vector<asset::MaterialMaps>& maps) {
  for (const inverse::PathVertex& vertex : path.vertices) {
    const auto shading =
        inverse::shade_values(vertex.point, inverse::sample_maps(maps[vertex.point.material], vertex.point));
    if (shading.d_normal_scale == 0.0f) return false;
  }
  return true;
}

std::vector<inverse::PathRecord> record_paths(const World& world, int depth) {
  render::PathOptions options;
  options.max_depth = depth;
  std::vector<inverse::PathRecord> paths;
  for (int y = 0; y < world.camera.height; ++y)
    for (int x = 0; x < world.camera.width; ++x)
      for (int s = 0; s < 2; ++s) {
        RandomStream random(3, RandomPurpose::kTest, static_cast<uint64_t>(y * world.camera.width + x),
                            static_cast<uint32_t>(s));
        auto path = inverse::record_path(world.scene, world.camera.ray(vec2(x, y) + random.uniform2()),
                                         options, random);
        if (has_free_normals(path, world.maps)) paths.push_back(std::move(path));
      }
  return paths;
}

const vec3 kAdjoint(0.5f, 1.0f, 0.7f);

TEST(path_replay, gradients_agree_with_central_differences) {
  int cases = 0;
  for (const Lighting lighting : kAllLighting)
    for (const int depth : {1, 2, 4})
      for (const int texture_size : {1, 8}) {
        const World world = make_world(lighting, texture_size, 12);
        const auto paths = record_paths(world, depth);
        inverse::TexelGradients gradients =
            inverse::zero_gradients(world.maps, static_cast<int>(world.maps.size()));
        for (const auto& path : paths)
          inverse::add_path_gradient(path, world.maps, world.scene.bsdf_model(), kAdjoint, gradients);
        for (const Parameter& parameter : kParameters) {
          const Direction direction = direction_of(world.maps, parameter);
          double analytic = 0, size = 0;
          for (size_t m = 0; m < world.maps.size(); ++m) {
            const Image& image = gradients.slots[m][static_cast<size_t>(parameter.slot)];
            for (size_t i = 0; i < image.pixels.size(); ++i) {
              analytic += static_cast<double>(image.pixels[i]) * direction[m][i];
              size += std::abs(static_cast<double>(image.pixels[i]) * direction[m][i]);
            }
          }
          const double numeric = derivative(
              [&](float step) {
                const auto maps = moved(world.maps, parameter, direction, step);
                double sum = 0;
                for (const auto& path : paths)
                  sum += glm::dot(kAdjoint, inverse::path_radiance(path, maps, world.scene.bsdf_model()));
                return sum;
              },
              step_of(parameter));
          EXPECT_NEAR(analytic, numeric, kRelativeError * size)
              << parameter.name << ", " << name_of(lighting) << ", depth " << depth << ", texture "
              << texture_size;
          EXPECT_GT(size, 0.0) << parameter.name << ", " << name_of(lighting);
          ++cases;
        }
      }
  EXPECT_EQ(cases, 120);
}

TEST(light_cache, gradients_agree_with_central_differences) {
  int cases = 0;
  for (const auto model : {render::BsdfModel::kGltf, render::BsdfModel::kPrincipled})
    for (const Lighting lighting : kAllLighting)
      for (const int depth : {1, 2, 4}) {
        const World world = make_world(lighting, 8, 12, model);
        const views::ViewSet views = view_of(world);
        inverse::CacheOptions options;
        options.max_depth = depth;
        const inverse::LightCache cache = traced_cache(world, views, options);
        inverse::TexelGradients gradients =
            inverse::zero_gradients(world.maps, static_cast<int>(world.maps.size()));
        inverse::Shader shader(model);
        for (size_t s = 0; s < cache.samples.size(); ++s) {
          const auto& sample = cache.samples[s];
          if (!sample.hit) continue;
          const auto shading = inverse::shade_values(sample.point, sample.base);
          shader.shade(sample, shading, cache.lights_of(s));
          inverse::splat(gradients, world.maps[sample.point.material], sample.point,
                         shader.adjoint(kAdjoint));
        }
        for (const Parameter& parameter : kParameters) {
          const Direction direction = direction_of(world.maps, parameter);
          double analytic = 0, size = 0;
          for (size_t m = 0; m < world.maps.size(); ++m) {
            const Image& image = gradients.slots[m][static_cast<size_t>(parameter.slot)];
            for (size_t i = 0; i < image.pixels.size(); ++i) {
              analytic += static_cast<double>(image.pixels[i]) * direction[m][i];
              size += std::abs(static_cast<double>(image.pixels[i]) * direction[m][i]);
            }
          }
          const double numeric = derivative(
              [&](float step) {
                const auto maps = moved(world.maps, parameter, direction, step);
                double sum = 0;
                for (size_t s = 0; s < cache.samples.size(); ++s) {
                  const auto& sample = cache.samples[s];
                  if (!sample.hit) continue;
                  const auto shading = inverse::shade_values(
                      sample.point, inverse::sample_maps(maps[sample.point.material], sample.point));
                  sum += glm::dot(kAdjoint, shader.shade(sample, shading, cache.lights_of(s)));
                }
                return sum;
              },
              step_of(parameter));
          EXPECT_NEAR(analytic, numeric, kRelativeError * size)
              << parameter.name << ", " << name_of(lighting) << ", depth " << depth << ", model "
              << static_cast<int>(model);
          ++cases;
        }
      }
  EXPECT_EQ(cases, 120);
}

TEST(light_cache, vector_shading_equals_the_reference) {
  const World world = make_world(Lighting::kStudio, 8, 16);
  const views::ViewSet views = view_of(world);
  const inverse::LightCache cache = traced_cache(world, views, {});
  for (size_t s = 0; s < cache.samples.size(); ++s) {
    const auto& sample = cache.samples[s];
    const auto shading = inverse::shade_values(sample.point, sample.base);
    const auto reference =
        inverse::shade_reference(render::BsdfModel::kGltf, sample, shading, cache.lights_of(s), kAdjoint);
    inverse::Shader shader(render::BsdfModel::kGltf);
    const vec3 radiance = shader.shade(sample, shading, cache.lights_of(s));
    const auto gradient = shader.adjoint(kAdjoint);
    ASSERT_LT(glm::length(radiance - reference.radiance), 1e-4f * (1e-3f + glm::length(reference.radiance)));
    const auto near = [](float a, float b) {
      return std::abs(a - b) <= 2e-3f * (std::abs(a) + std::abs(b)) + 1e-4f;
    };
    for (int c = 0; c < 3; ++c) ASSERT_TRUE(near(gradient.base_color[c], reference.gradient.base_color[c]));
    ASSERT_TRUE(near(gradient.roughness, reference.gradient.roughness))
        << gradient.roughness << " " << reference.gradient.roughness;
    ASSERT_TRUE(near(gradient.metallic, reference.gradient.metallic));
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(gradient.normal[c], reference.gradient.normal[c],
                  2e-3f * (0.05f + glm::length(reference.gradient.normal)));
  }
}

}  // namespace
}  // namespace patina::test
