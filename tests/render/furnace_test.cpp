// White furnace: under uniform light a surface shows its albedo, and one that absorbs nothing cannot be told
// from the light.
#include <gtest/gtest.h>

#include "patina/render/path_tracer.h"
#include "scenes.h"
#include "statistics.h"

namespace patina::render {
namespace {

using test::Part;

struct SphereScene {
  std::vector<Part> parts;
  asset::Asset asset;
  Scene scene;
  Camera camera;

  SphereScene(const test::Constant& constant, BsdfModel model, float radius = 1.0f,
              const vec3& at = vec3(0.0f))
      : parts{{test::sphere(at, radius, 96), constant}},
        asset(test::make_asset(parts)),
        scene(asset, test::make_maps(parts), constant_environment(vec3(1.0f)), nullptr, {model}),
        camera(look_at(at + radius * vec3(0, 1.5f, 3.0f), at, 0.7f, 32, 32)) {}
};

/// Sum of the rendered radiance over the pixels that the sphere covers, and the sum that quadrature of the
/// BSDF promises there.
struct Furnace {
  double rendered = 0, promised = 0, covered = 0;
};

Furnace furnace(const SphereScene& sphere, const BsdfParams& params, BsdfModel model) {
  PathOptions options;
  options.samples_per_pixel = 128;
  options.max_depth = 8;
  const Render result = render(sphere.scene, sphere.camera, options);

  constexpr int kTable = 32;  // albedo at equal steps of cos θ, read linearly
  std::vector<double> table;
  for (int i = 0; i <= kTable; ++i) {
    const float z = std::max(static_cast<float>(i) / kTable, 0.004f);
    const vec3 wo(std::sqrt(1.0f - z * z), 0.0f, z);
    table.push_back(
        test::integrate_hemisphere([&](const vec3& wi) { return eval_bsdf(model, params, wo, wi).x; }));
  }
  const auto albedo = [&](float cosine) {
    const double x = cosine * kTable;
    const auto i = static_cast<size_t>(std::min(std::max(x, 0.0), kTable - 1.0));
    return table[i] + (x - static_cast<double>(i)) * (table[i + 1] - table[i]);
  };

  Furnace out;
  for (int y = 0; y < sphere.camera.height; ++y)
    for (int x = 0; x < sphere.camera.width; ++x) {
      if (result.coverage.at(x, y)[0] < 1.0f) continue;  // the silhouette is sampled too coarsely to compare
      out.covered += 1;
      out.rendered += result.radiance.rgb(x, y).x;
      constexpr int kSide = 4;
      for (int i = 0; i < kSide * kSide; ++i) {
        const vec2 pixel(static_cast<float>(x) + (static_cast<float>(i % kSide) + 0.5f) / kSide,
                         static_cast<float>(y) + (static_cast<float>(i / kSide) + 0.5f) / kSide);
        const Ray ray = sphere.camera.ray(pixel);
        const auto hit = sphere.scene.intersect(ray);
        if (hit)
          out.promised +=
              albedo(-glm::dot(ray.direction, sphere.scene.surface(ray, *hit).n_shading)) / (kSide * kSide);
      }
    }
  return out;
}

TEST(furnace, sphere_shows_the_albedo_that_quadrature_promises) {
  for (const BsdfModel model : {BsdfModel::kGltf, BsdfModel::kPrincipled})
    for (const float metallic : {0.0f, 1.0f})
      for (const float roughness : {0.3f, 0.6f, 1.0f}) {
        const SphereScene sphere({vec3(1.0f), roughness, metallic}, model);
        const Furnace result = furnace(sphere, {vec3(1.0f), roughness, metallic}, model);
        ASSERT_GT(result.covered, 200);
        EXPECT_NEAR(result.rendered / result.promised, 1.0, 0.01)
            << "model " << static_cast<int>(model) << " metallic " << metallic << " roughness " << roughness;
      }
}

TEST(furnace, lossless_surfaces_vanish_in_the_light) {
  // A smooth white metal loses nothing, a white dielectric of roughness 0.6 nearly nothing averaged over all
  // views.
  for (const auto& [roughness, metallic] :
       {std::pair(0.05f, 1.0f), std::pair(0.1f, 1.0f), std::pair(0.6f, 0.0f)}) {
    const SphereScene sphere({vec3(1.0f), roughness, metallic}, BsdfModel::kGltf);
    PathOptions options;
    options.samples_per_pixel = 128;
    const Render result = render(sphere.scene, sphere.camera, options);
    double sum = 0, count = 0;
    for (size_t i = 0; i < result.coverage.pixels.size(); ++i) {
      if (result.coverage.pixels[i] < 1.0f) continue;
      sum += result.radiance.pixels[3 * i];
      count += 1;
    }
    EXPECT_GT(sum / count, 0.99) << roughness;
    EXPECT_LT(sum / count, 1.01) << roughness;
  }
}

TEST(furnace, size_and_place_of_the_asset_change_nothing) {
  // From a coin to a planet, and far from the origin: neither self-shadowing nor light through the surface.
  const auto mean = [](float radius, const vec3& at) {
    const SphereScene sphere({vec3(0.8f), 0.6f, 0.0f}, BsdfModel::kGltf, radius, at);
    PathOptions options;
    options.samples_per_pixel = 64;
    const Render result = render(sphere.scene, sphere.camera, options);
    double sum = 0, count = 0;
    for (size_t i = 0; i < result.coverage.pixels.size(); ++i)
      if (result.coverage.pixels[i] == 1.0f) sum += result.radiance.pixels[3 * i], count += 1;
    return sum / count;
  };
  const double reference = mean(1.0f, vec3(0.0f));
  for (const float radius : {1e-4f, 0.01f, 150.0f, 2e9f})
    EXPECT_NEAR(mean(radius, vec3(0.0f)), reference, 0.005) << radius;
  EXPECT_NEAR(mean(1.0f, vec3(200.0f, 10.0f, -300.0f)), reference, 0.01);
}

TEST(furnace, inside_of_a_glowing_sphere_is_the_neumann_series_of_its_material) {
  // Inside a sphere a ray that leaves at angle θ arrives at angle θ, so radiance depends on θ alone and obeys
  // L(θo) = Le + ∫ f(θo, ωi) cos θi L(θi) dωi; a path tracer of depth N sums the first N + 1 terms.
  constexpr float kEmission = 0.5f, kAlbedo = 0.7f, kRoughness = 0.8f;
  constexpr int kDepth = 6, kSteps = 128;
  const BsdfParams params{vec3(kAlbedo), kRoughness, 0.0f};
  std::vector<std::vector<double>> kernel(kSteps,
                                          std::vector<double>(kSteps));  // [θo][θi], azimuth integrated
  const auto cosine = [](int i) { return (static_cast<float>(i) + 0.5f) / kSteps; };
  for (int o = 0; o < kSteps; ++o)
    for (int i = 0; i < kSteps; ++i) {
      const float zo = cosine(o), zi = cosine(i);
      const vec3 wo(std::sqrt(1 - zo * zo), 0, zo);
      constexpr int kAzimuths = 64;
      for (int a = 0; a < kAzimuths; ++a) {
        const float phi = 2.0f * kPi * (static_cast<float>(a) + 0.5f) / kAzimuths, r = std::sqrt(1 - zi * zi);
        kernel[static_cast<size_t>(o)][static_cast<size_t>(i)] +=
            eval_bsdf(BsdfModel::kGltf, params, wo, vec3(r * std::cos(phi), r * std::sin(phi), zi)).x *
            (2.0f * kPi / kAzimuths) / kSteps;
      }
    }
  std::vector<double> expected(kSteps, kEmission);
  for (int n = 0; n < kDepth; ++n) {
    std::vector<double> next(kSteps, kEmission);
    for (size_t o = 0; o < kSteps; ++o)
      for (size_t i = 0; i < kSteps; ++i) next[o] += kernel[o][i] * expected[i];
    expected = next;
  }

  const std::vector<Part> parts{
      {test::sphere(vec3(0.0f), 2.0f, 96), {vec3(kAlbedo), kRoughness, 0.0f, vec3(kEmission)}}};
  const asset::Asset asset = test::make_asset(parts);
  const Scene scene(asset, test::make_maps(parts), constant_environment(vec3(100.0f)));  // must not leak in
  PathOptions options;
  options.max_depth = kDepth;
  options.roulette_depth = 3;
  for (const float z : {0.95f, 0.7f, 0.4f}) {
    // From a point near the wall, at an angle whose cosine at the far wall is z.
    const vec3 origin(0.0f, 0.1f, -1.99f);
    const vec3 direction(std::sqrt(1 - z * z), 0.0f, z);
    double sum = 0, squares = 0;
    constexpr int kCount = 20000;
    double mean_expected = 0;
    const Ray ray{origin, direction};
    const SurfacePoint point = scene.surface(ray, *scene.intersect(ray));
    const double x = -glm::dot(point.n_shading, direction) * kSteps - 0.5;
    const auto k = static_cast<size_t>(x);
    mean_expected =
        expected[k] + (x - std::floor(x)) * (expected[std::min<size_t>(k + 1, kSteps - 1)] - expected[k]);
    for (int i = 0; i < kCount; ++i) {
      RandomStream random(31, RandomPurpose::kTest, static_cast<uint64_t>(i));
      const double value = trace_path(scene, ray, options, random).x;
      sum += value;
      squares += value * value;
    }
    const double mean = sum / kCount, error = std::sqrt((squares / kCount - mean * mean) / kCount);
    EXPECT_NEAR(mean, mean_expected, 4 * error + 0.005 * mean_expected) << "cos " << z;
    EXPECT_LT(error, 0.02 * mean_expected);
  }
}

}  // namespace
}  // namespace patina::render
