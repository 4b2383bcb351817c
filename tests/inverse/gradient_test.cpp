// Gradients of the path replay and of the light cache against central differences, over parameter × lighting
// × depth × texture filter, and texel by texel on a real asset. Sampling is held fixed (common random
// numbers), so the functions are smooth and the comparison is tight.
#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "patina/base/random.h"
#include "patina/image/color.h"
#include "patina/inverse/evaluate.h"
#include "patina/inverse/fit_slots.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/path_replay.h"
#include "patina/inverse/shade.h"
#include "support.h"
#include "worlds.h"

namespace patina::test {
namespace {

using asset::MapSlot;

struct Parameter {
  const char* name;
  MapSlot slot;
  int channel;  // -1: all
};
constexpr Parameter kParameters[] = {{"base colour", MapSlot::kBaseColor, -1},
                                     {"roughness", MapSlot::kRoughness, -1},
                                     {"metallic", MapSlot::kMetallic, -1},
                                     {"normal x", MapSlot::kNormal, 0},
                                     {"normal y", MapSlot::kNormal, 1}};

// A fixed random direction in the space of one parameter's texels; material by material.
using Direction = std::vector<std::vector<float>>;
Direction direction_of(const std::vector<asset::MaterialMaps>& maps, const Parameter& parameter) {
  Direction direction;
  for (size_t m = 0; m < maps.size(); ++m) {
    const Image& texels = asset::slot_map(maps[m], parameter.slot).texels;
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
    Image& texels = asset::slot_map(maps[m], parameter.slot).texels;
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
  return parameter.slot == MapSlot::kNormal ? 1e-3f : 1e-2f;
}
// Of the sum of the sizes of all texels' shares. What is smooth in its parameter agrees to 5e-4; normals meet
// horizons, where the derivative jumps, and the fourth-order difference leaves something.
double relative_error(const Parameter& parameter) {
  return parameter.slot == MapSlot::kNormal ? 5e-3 : 5e-4;
}

// `gradients` against central differences of value(maps), for every parameter. Returns how many were checked.
template <class Value>
int check_gradients(const std::vector<asset::MaterialMaps>& maps, const inverse::TexelGradients& gradients,
                    const std::string& where, const Value& value) {
  for (const Parameter& parameter : kParameters) {
    const Direction direction = direction_of(maps, parameter);
    double analytic = 0, size = 0;
    for (size_t m = 0; m < maps.size(); ++m) {
      const Image& image = gradients.slots[m][static_cast<size_t>(parameter.slot)];
      for (size_t i = 0; i < image.pixels.size(); ++i) {
        analytic += static_cast<double>(image.pixels[i]) * direction[m][i];
        size += std::abs(static_cast<double>(image.pixels[i]) * direction[m][i]);
      }
    }
    const double numeric = derivative(
        [&](float step) { return value(moved(maps, parameter, direction, step)); }, step_of(parameter));
    EXPECT_NEAR(analytic, numeric, relative_error(parameter) * size) << parameter.name << ", " << where;
    EXPECT_GT(size, 0.0) << parameter.name << ", " << where;
  }
  return static_cast<int>(std::size(kParameters));
}

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
        cases += check_gradients(
            world.maps, gradients,
            std::string(name_of(lighting)) + ", depth " + std::to_string(depth) + ", texture " +
                std::to_string(texture_size),
            [&](const std::vector<asset::MaterialMaps>& maps) {
              double sum = 0;
              for (const auto& path : paths)
                sum += glm::dot(glm::dvec3(kAdjoint),
                                glm::dvec3(inverse::path_radiance(path, maps, world.scene.bsdf_model())));
              return sum;
            });
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
          const auto shading = inverse::shade_values(
              sample.point, inverse::sample_maps(world.maps[sample.point.material], sample.point));
          shader.shade(sample, shading, cache.lights_of(s));
          inverse::splat(gradients, world.maps[sample.point.material], sample.point,
                         shader.adjoint(kAdjoint));
        }
        cases += check_gradients(
            world.maps, gradients,
            std::string(name_of(lighting)) + ", depth " + std::to_string(depth) + ", model " +
                std::to_string(static_cast<int>(model)),
            [&](const std::vector<asset::MaterialMaps>& maps) {
              double sum = 0;
              for (size_t s = 0; s < cache.samples.size(); ++s) {
                const auto& sample = cache.samples[s];
                const auto shading = inverse::shade_values(
                    sample.point, inverse::sample_maps(maps[sample.point.material], sample.point));
                sum += glm::dot(glm::dvec3(kAdjoint),
                                glm::dvec3(shader.shade(sample, shading, cache.lights_of(s))));
              }
              return sum;
            });
      }
  EXPECT_EQ(cases, 120);
}

TEST(light_cache, vector_shading_equals_the_reference) {
  const World world = make_world(Lighting::kStudio, 8, 16);
  const views::ViewSet views = view_of(world);
  inverse::LightCache cache = traced_cache(world, views, {});
  // The reference knows surfaces that do not turn within a pixel.
  for (inverse::CacheSample& sample : cache.samples) sample.extent = 0;
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

// The whole way from a texel to the loss, on an asset made by somebody else: 1,000 texels of its four maps
// at random, one after the other.
TEST(light_cache, gradients_of_a_real_asset_agree_texel_by_texel) {
  PATINA_REQUIRE_SHARED("assets/WaterBottle/WaterBottle.gltf");
  const asset::Asset bottle = asset::read_asset(shared_dir() / "assets/WaterBottle/WaterBottle.gltf");
  auto maps = asset::resolve_materials(bottle);
  // Away from the bounds, where derivatives jump.
  for (float& value : maps[0].metallic.texels.pixels) value = 0.2f + 0.6f * value;
  render::Scene scene(bottle, maps, render::studio_environment());
  views::OrbitOptions orbit;
  orbit.resolution = 56;
  orbit.num_views = 4;
  views::ViewOptions view_options;
  view_options.path.samples_per_pixel = 4;
  const views::ViewSet views =
      views::render_views(scene, views::orbit_cameras(asset::bounds(bottle), orbit), view_options, {});
  std::vector<Image> targets, weights;
  for (const views::View& view : views.views) {
    Image& target = targets.emplace_back(tone_map(view.radiance, views.exposure_ev));
    for (float& value : target.pixels)
      value = linear_from_srgb(0.6f * value);  // another picture than it shows
    weights.push_back(inverse::loss_weight(view.gbuffer, {}, 1));
  }
  inverse::LightCache cache;
  cache.pixels = inverse::select_pixels(views, targets, weights);
  std::vector<inverse::SeenPoint> seen = inverse::trace_seen_points(scene, views, cache.pixels);
  inverse::make_samples(cache, scene, maps, seen);
  inverse::trace_light(cache, scene, maps, views, {}, {});

  std::vector<inverse::FittedMap> fitted;
  for (const MapSlot slot :
       {MapSlot::kBaseColor, MapSlot::kRoughness, MapSlot::kMetallic, MapSlot::kNormal}) {
    const asset::Map& map = asset::slot_map(maps[0], slot);
    inverse::FittedMap& entry = fitted.emplace_back();
    entry.slot = slot;
    entry.field = inverse::make_field(map, 64, 64, inverse::fit_slot(slot).unknowns);
    entry.evidence = inverse::evidence_of(map, 64, 64, slot, 0, seen);
    entry.may_change = Image(64, 64, 1);
    std::fill(entry.may_change.pixels.begin(), entry.may_change.pixels.end(), 1.0f);
  }
  const float gain = std::exp2(views.exposure_ev);
  inverse::Evaluator evaluator(fitted, seen, scene.bsdf_model(), gain);
  for (inverse::CachePixel& pixel : cache.pixels) pixel.calibration = {0.8f, 1.0f, 1.3f};
  evaluator.evaluate(cache);

  // What Gauss-Newton takes for the gradient: residuals' scales stay where they are (PixelResidual).
  const std::vector<vec3> start = evaluator.radiance();
  const auto loss = [&] {
    const std::vector<vec3> of_samples = evaluator.shade_samples(cache);
    double sum = 0;
    for (size_t i = 0; i < cache.pixels.size(); ++i) {
      const inverse::CachePixel& pixel = cache.pixels[i];
      vec3 now(0.0f);
      for (size_t s = cache.first_sample[i]; s < cache.first_sample[i + 1]; ++s)
        now += cache.samples[s].share * pixel.calibration * of_samples[s];
      for (int c = 0; c < 3; ++c) {
        const double reference = std::max(reinhard(gain * start[i][c]), pixel.target[c]);
        sum += pixel.weight * square(double{reinhard(gain * now[c])} - pixel.target[c]) /
               (3 * (square(reference) + inverse::kLossEpsilon));
      }
    }
    return sum;
  };
  std::vector<Image> gradients;
  for (size_t f = 0; f < fitted.size(); ++f) {
    std::vector<float> of_samples(cache.samples.size() * inverse::kNumValues);
    for (size_t i = 0; i < cache.samples.size(); ++i)
      for (size_t c = 0; c < 3; ++c)
        for (size_t v = 0; v < inverse::kNumValues; ++v)
          of_samples[i * inverse::kNumValues + v] +=
              evaluator.residuals()[cache.samples[i].pixel][static_cast<int>(c)] *
              (&evaluator.terms()[i].derivative[c].base_color.x)[v];
    gradients.push_back(fitted[f].field.delta.texels);
    inverse::gather_from_samples(evaluator.taps_of(f),
                                 of_samples.data() + inverse::fit_slot(fitted[f].slot).first_value,
                                 inverse::kNumValues, gradients.back());
  }
  RandomStream random(5, RandomPurpose::kTest, 0);
  std::array<double, 4> error{}, size{};
  for (int checked = 0; checked < 1000;) {
    const auto which = static_cast<size_t>(random.uniform() * 4);
    inverse::FittedMap& map = fitted[which];
    std::vector<float>& values = map.field.delta.texels.pixels;
    const auto i = static_cast<size_t>(random.uniform() * static_cast<float>(values.size()));
    const auto channels = static_cast<size_t>(map.field.delta.texels.channels);
    if (map.evidence.pixels[i / channels] < 0.05f) continue;
    const float before = values[i];
    const double numeric = derivative(
        [&](float step) {
          values[i] = before + step;
          const double value = loss();
          values[i] = before;
          return value;
        },
        which == 3 ? 1e-3f : 1e-2f);
    const double analytic = gradients[which].pixels[i];
    error[which] += square(analytic - numeric), size[which] += square(numeric);
    ++checked;
  }
  const double limits[] = {5e-4, 5e-4, 5e-4, 2e-2};
  for (size_t which = 0; which < 4; ++which)
    EXPECT_LT(std::sqrt(error[which] / size[which]), limits[which]) << "map " << which;
}

}  // namespace
}  // namespace patina::test
