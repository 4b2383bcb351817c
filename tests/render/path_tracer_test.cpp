// The path tracer against closed forms, against quadrature, and against plain estimators that share none of
// its weights.
#include "patina/render/path_tracer.h"

#include <gtest/gtest.h>

#include <mutex>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/render/lights.h"
#include "scenes.h"
#include "statistics.h"

namespace patina::render {
namespace {

using test::Part;

struct Local {
  Basis basis;
  vec3 n;
  explicit Local(const vec3& normal) : basis(orthonormal_basis(normal)), n(normal) {}
  vec3 to(const vec3& v) const {
    return {glm::dot(v, basis.tangent), glm::dot(v, basis.bitangent), glm::dot(v, n)};
  }
  vec3 from(const vec3& v) const { return v.x * basis.tangent + v.y * basis.bitangent + v.z * n; }
};

/// A path tracer that meets lights only by chance (kBsdfOnly) or only by sampling them (kLightOnly): no MIS,
/// no roulette.
enum class Strategy { kBsdfOnly, kLightOnly };
vec3 trace_plain(const Scene& scene, Ray ray, int max_depth, Strategy strategy, RandomStream& random) {
  vec3 sum(0.0f), throughput(1.0f);
  for (int depth = 0;; ++depth) {
    const bool counts = depth == 0 || strategy == Strategy::kBsdfOnly;
    const auto hit = scene.intersect(ray, random.uniform());
    if (!hit)
      return depth > 0 && counts ? sum + throughput * scene.environment().radiance(ray.direction) : sum;
    const SurfacePoint point = scene.surface(ray, *hit);
    if (counts) sum += throughput * point.emission;
    if (depth == max_depth) return sum;
    const Local frame(point.n_shading);
    const vec3 wo = frame.to(-ray.direction);
    if (strategy == Strategy::kLightOnly) {
      const float u_light = random.uniform();
      const auto light = scene.light_sampler().sample_extended(point.p_world, u_light, random.uniform2());
      if (light && glm::dot(light->direction, point.n_geometric) > 0.0f) {
        const Ray shadow =
            light->at_infinity ? spawn_ray(point, light->direction) : spawn_segment(point, light->p_light);
        if (!scene.occluded(shadow, random.uniform()))
          sum += throughput * eval_bsdf(scene.bsdf_model(), point.bsdf, wo, frame.to(light->direction)) *
                 light->radiance / light->pdf;
      }
    }
    const float u_lobe = random.uniform();
    const BsdfSample sample = sample_bsdf(scene.bsdf_model(), point.bsdf, wo, u_lobe, random.uniform2());
    const vec3 direction = frame.from(sample.wi);
    if (!(sample.pdf > 0.0f) || !(glm::dot(direction, point.n_geometric) > 0.0f)) return sum;
    throughput *= sample.weight;
    ray = spawn_ray(point, direction);
  }
}

/// Mean and its standard error, per channel.
struct Estimate {
  glm::dvec3 mean{0.0}, error{0.0};
};
template <class Trace>
Estimate estimate(int count, uint64_t seed, Trace trace) {
  glm::dvec3 sum(0.0), squares(0.0);
  for (int i = 0; i < count; ++i) {
    RandomStream random(seed, RandomPurpose::kTest, static_cast<uint64_t>(i));
    const glm::dvec3 value(trace(random));
    sum += value;
    squares += value * value;
  }
  const glm::dvec3 mean = sum / static_cast<double>(count);
  return {mean, glm::sqrt(glm::max(squares / static_cast<double>(count) - mean * mean, 0.0) /
                          static_cast<double>(count))};
}

constexpr test::Constant kMatte{.base_color = vec3(0.6f, 0.5f, 0.4f), .roughness = 0.7f};
const Ray kLookDown{{0.0f, 2.0f, 1.0f}, {0.0f, -0.894427191f, -0.447213595f}};  // meets the origin

/// What a matte floor at the origin reflects toward kLookDown's origin of light from `direction` (unit,
/// world).
vec3 reflected(const vec3& direction, BsdfModel model = BsdfModel::kGltf) {
  const Local frame({0, 1, 0});
  return eval_bsdf(model, {kMatte.base_color, kMatte.roughness, kMatte.metallic},
                   frame.to(-kLookDown.direction), frame.to(direction));
}

void expect_radiance(const Scene& scene, const vec3& expected, float tolerance) {
  PathOptions options;
  options.max_depth = 1;
  const Estimate got =
      estimate(64, 61, [&](RandomStream& random) { return trace_path(scene, kLookDown, options, random); });
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(got.mean[c], expected[c], tolerance * expected[c]);
}

TEST(path_tracer, point_light_gives_intensity_times_cosine_over_squared_distance) {
  const std::vector<Part> parts{{test::floor(10.0f), kMatte}};
  asset::Asset asset = test::make_asset(parts);
  asset::Light light;
  light.p_world = {1.0f, 2.0f, -0.5f};
  light.color = {1.0f, 0.5f, 0.25f};
  light.intensity = 7.0f;
  const vec3 direction = glm::normalize(light.p_world);
  const float distance2 = glm::dot(light.p_world, light.p_world);
  asset.lights = {light};
  expect_radiance(Scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f))),
                  reflected(direction) * light.color * 7.0f / distance2, 1e-4f);
  // Range windows the inverse square [KHR_lights_punctual].
  asset.lights[0].range = 3.0f;
  expect_radiance(Scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f))),
                  reflected(direction) * light.color * 7.0f / distance2 * (1.0f - square(distance2 / 9.0f)),
                  1e-4f);
}

TEST(path_tracer, spot_light_fades_between_its_cones) {
  const std::vector<Part> parts{{test::floor(10.0f), kMatte}};
  asset::Asset asset = test::make_asset(parts);
  asset::Light light;
  light.kind = asset::LightKind::kSpot;
  light.p_world = {0.0f, 3.0f, 0.0f};
  light.intensity = 5.0f;
  light.inner_cone_angle = 0.2f, light.outer_cone_angle = 0.6f;
  const auto render_with_tilt = [&](float tilt, float factor) {
    light.direction_world = {std::sin(tilt), -std::cos(tilt), 0.0f};
    asset.lights = {light};
    const Scene scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f)));
    if (factor > 0.0f) return expect_radiance(scene, reflected({0, 1, 0}) * 5.0f / 9.0f * factor, 1e-3f);
    EXPECT_EQ(estimate(8, 62, [&](RandomStream& r) { return trace_path(scene, kLookDown, {}, r); }).mean.x,
              0.0);
  };
  render_with_tilt(0.1f, 1.0f);
  const float fade = (std::cos(0.4f) - std::cos(0.6f)) / (std::cos(0.2f) - std::cos(0.6f));
  render_with_tilt(0.4f, fade * fade);
  render_with_tilt(0.7f, 0.0f);
}

TEST(path_tracer, directional_light_does_not_fall_off_and_casts_shadows) {
  std::vector<Part> parts{{test::floor(10.0f), kMatte}};
  asset::Asset asset = test::make_asset(parts);
  asset::Light light;
  light.kind = asset::LightKind::kDirectional;
  light.direction_world = -glm::normalize(vec3(0.3f, 1.0f, 0.2f));
  light.intensity = 2.0f;
  asset.lights = {light};
  expect_radiance(Scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f))),
                  reflected(-light.direction_world) * 2.0f, 1e-4f);
  // A sphere of the context stands in the light.
  const std::vector<Part> blocker{{test::sphere(3.0f * vec3(0.3f, 1.0f, 0.2f), 0.3f, 16), kMatte}};
  const asset::Asset context = test::make_asset(blocker);
  const Scene shadowed(asset, test::make_maps(parts), constant_environment(vec3(0.0f)), &context, {});
  PathOptions options;
  options.max_depth = 1;
  EXPECT_EQ(
      estimate(64, 63, [&](RandomStream& r) { return trace_path(shadowed, kLookDown, options, r); }).mean.x,
      0.0);
}

/// Lambert's formula: irradiance at the origin with normal +Y of a polygon of uniform unit radiance
/// [Lambert1760].
double polygon_irradiance(const std::vector<vec3>& corners) {
  double sum = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const glm::dvec3 a = glm::normalize(glm::dvec3(corners[i])),
                     b = glm::normalize(glm::dvec3(corners[(i + 1) % corners.size()]));
    const glm::dvec3 cross = glm::cross(a, b);
    sum += std::acos(glm::clamp(glm::dot(a, b), -1.0, 1.0)) * glm::normalize(cross).y;
  }
  return std::abs(0.5 * sum);
}

TEST(path_tracer, area_light_irradiance_is_lamberts_closed_form) {
  const vec3 corner(-0.5f, 1.5f, -1.0f), a(1.5f, 0.2f, 0), b(0, 0.3f, 1.2f);
  const std::vector<Part> parts{{test::floor(10.0f), kMatte},
                                {test::quad(corner, a, b), {.emission = vec3(2.0f)}}};
  const asset::Asset asset = test::make_asset(parts);
  const Scene scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f)));
  const Estimate irradiance = estimate(20000, 64, [&](RandomStream& random) {
    const float u_light = random.uniform();
    const auto light = scene.light_sampler().sample_extended(vec3(0.0f), u_light, random.uniform2());
    return light ? light->radiance * std::max(0.0f, light->direction.y) / light->pdf : vec3(0.0f);
  });
  const double expected = 2.0 * polygon_irradiance({corner, corner + a, corner + a + b, corner + b});
  EXPECT_NEAR(irradiance.mean.x, expected, 4 * irradiance.error.x + 1e-4);
  EXPECT_LT(irradiance.error.x, 0.01 * expected);
}

TEST(path_tracer, area_light_on_a_floor_is_the_integral_over_the_light) {
  const vec3 corner(-0.5f, 1.0f, -1.0f), a(1.5f, 0.2f, 0), b(0, 0.3f, 1.2f);
  const std::vector<Part> parts{
      {test::floor(10.0f), kMatte},
      {test::quad(corner, a, b), {.base_color = vec3(0.0f), .emission = vec3(2.0f)}}};
  const asset::Asset asset = test::make_asset(parts);
  for (const BsdfModel model : {BsdfModel::kGltf, BsdfModel::kPrincipled}) {
    const Scene scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f)), nullptr, {model});
    const vec3 normal = glm::cross(a, b);  // its length is the area
    const double expected = test::integrate(
        [&](double u, double v) {
          const vec3 p = corner + static_cast<float>(u) * a + static_cast<float>(v) * b;
          const vec3 direction = glm::normalize(p);
          return 2.0 * reflected(direction, model).x * std::abs(glm::dot(normal, direction)) / glm::dot(p, p);
        },
        0, 1, 0, 1);
    PathOptions options;
    options.max_depth = 1;
    const Ray ray{{0.0f, 0.8f, 0.4f}, kLookDown.direction};  // below the light
    const Estimate got =
        estimate(20000, 65, [&](RandomStream& random) { return trace_path(scene, ray, options, random); });
    EXPECT_NEAR(got.mean.x, expected, 4 * got.error.x + 1e-4 * expected);
    EXPECT_LT(got.error.x, 0.01 * expected);
  }
}

TEST(path_tracer, blend_mixes_with_what_lies_behind_and_mask_cuts) {
  PathOptions options;
  options.max_depth = 1;
  const auto mean = [&](asset::AlphaMode mode, float alpha) {
    const std::vector<Part> parts{
        {test::floor(10.0f, 0.5f),
         {.base_color = vec3(0.0f), .emission = vec3(1.0f), .alpha = alpha, .alpha_mode = mode}},
        {test::floor(10.0f), {.base_color = vec3(0.0f), .emission = vec3(3.0f)}}};
    const asset::Asset asset = test::make_asset(parts);
    const Scene scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f)));
    options.max_depth = 0;
    return estimate(20000, 66,
                    [&](RandomStream& random) { return trace_path(scene, kLookDown, options, random); });
  };
  const Estimate blend = mean(asset::AlphaMode::kBlend, 0.3f);
  EXPECT_NEAR(blend.mean.x, 0.3 * 1.0 + 0.7 * 3.0, 4 * blend.error.x);
  EXPECT_EQ(mean(asset::AlphaMode::kMask, 0.3f).mean.x, 3.0);
  EXPECT_EQ(mean(asset::AlphaMode::kMask, 0.7f).mean.x, 1.0);
}

TEST(path_tracer, blended_surfaces_cast_partial_shadows) {
  std::vector<Part> parts{{test::floor(10.0f), kMatte},
                          {test::quad({-1, 1, 1}, {2, 0, 0}, {0, 0, -2}),
                           {.alpha = 0.25f, .alpha_mode = asset::AlphaMode::kBlend}}};
  asset::Asset asset = test::make_asset(parts);
  asset::Light light;
  light.p_world = {0.0f, 4.0f, 0.0f};
  light.intensity = 16.0f;
  asset.lights = {light};
  const Scene scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f)));
  PathOptions options;
  options.max_depth = 1;
  const Ray ray{{0.0f, 0.8f, 0.4f}, kLookDown.direction};
  const Estimate got =
      estimate(20000, 67, [&](RandomStream& random) { return trace_path(scene, ray, options, random); });
  EXPECT_NEAR(got.mean.x, 0.75 * reflected({0, 1, 0}).x, 4 * got.error.x);
}

/// A small room of the things that disagree when a weight is wrong: emitter near a floor, glossy sphere,
/// uneven sky.
struct Room {
  std::vector<Part> parts{{test::floor(3.0f), {.base_color = vec3(0.7f, 0.6f, 0.5f), .roughness = 0.5f}},
                          {test::sphere({0.2f, 0.6f, 0.0f}, 0.6f, 24),
                           {.base_color = vec3(0.9f, 0.7f, 0.3f), .roughness = 0.45f, .metallic = 1.0f}},
                          {test::quad({-1.6f, 0.3f, -0.8f}, {0, 0, 1.4f}, {0.3f, 1.2f, 0}),
                           {.base_color = vec3(0.2f), .emission = vec3(1.5f, 1.2f, 1.0f)}}};
  asset::Asset asset = test::make_asset(parts);
  Scene scene;
  Camera camera = look_at({1.2f, 1.6f, 3.2f}, {0, 0.4f, 0}, 0.7f, 14, 14);

  static Environment sky() {
    Image map(16, 8, 3, 0.2f);
    map.set_rgb(12, 2, vec3(3.0f, 2.5f, 2.0f));
    map.set_rgb(13, 2, vec3(3.0f, 2.5f, 2.0f));
    return Environment(map);
  }
  explicit Room(BsdfModel model) : scene(asset, test::make_maps(parts), sky(), nullptr, {model}) {}
};

// [H,W,3] sample variance / samples of every pixel as render() samples it: the variance of the pixel's mean
// if its samples were independent. Being spread evenly (RandomStream::even), they vary less: an upper bound.
Image variance_of_means(const Scene& scene, const Camera& camera, const PathOptions& options) {
  const int samples = options.samples_per_pixel;
  Image out(camera.width, camera.height, 3);
  parallel_for(0, static_cast<int64_t>(out.num_pixels()), 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int x = static_cast<int>(i % camera.width), y = static_cast<int>(i / camera.width);
      glm::dvec3 sum(0.0), sum_of_squares(0.0);
      for (int s = 0; s < samples; ++s) {
        RandomStream random = RandomStream::even(options.seed, RandomPurpose::kPathTracing,
                                                 static_cast<uint64_t>(i), static_cast<uint32_t>(s));
        const vec2 position = vec2(static_cast<float>(x), static_cast<float>(y)) + random.uniform2();
        const glm::dvec3 value(trace_path(scene, camera.ray(position), options, random));
        sum += value, sum_of_squares += value * value;
      }
      const glm::dvec3 spread = glm::max(sum_of_squares - sum * sum / static_cast<double>(samples), 0.0);
      out.set_rgb(x, y, vec3(spread / (static_cast<double>(samples) * (samples - 1))));
    }
  });
  return out;
}

TEST(path_tracer, every_pixel_agrees_with_estimators_that_use_no_weights) {
  // z-test of each pixel's mean against a long render by chance alone and one by light sampling alone.
  constexpr int kDepth = 3, kPlainSamples = 6000;
  const Room room(BsdfModel::kGltf);
  PathOptions options;
  options.samples_per_pixel = 1024;
  options.max_depth = kDepth;
  options.roulette_depth = 1;
  const Render result = render(room.scene, room.camera, options);
  const Image variance_of_mean = variance_of_means(room.scene, room.camera, options);
  const int width = room.camera.width, height = room.camera.height;
  const double bound = test::sidak_bound(2 * width * height);

  for (const Strategy strategy : {Strategy::kBsdfOnly, Strategy::kLightOnly}) {
    std::vector<Estimate> plain(static_cast<size_t>(width * height));
    parallel_for(0, width * height, 4, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i)
        plain[static_cast<size_t>(i)] =
            estimate(kPlainSamples, 70 + static_cast<uint64_t>(i), [&](RandomStream& random) {
              const vec2 pixel(static_cast<float>(i % width), static_cast<float>(i / width));
              return trace_plain(room.scene, room.camera.ray(pixel + random.uniform2()), kDepth, strategy,
                                 random);
            });
    });
    double worst = 1.0, sum_mis = 0, sum_plain = 0;
    for (size_t i = 0; i < plain.size(); ++i) {
      const double variance = variance_of_mean.pixels[3 * i] + square(static_cast<float>(plain[i].error.x));
      const double difference = result.radiance.pixels[3 * i] - plain[i].mean.x;
      sum_mis += result.radiance.pixels[3 * i];
      sum_plain += plain[i].mean.x;
      worst = std::min(worst, variance > 0 ? test::normal_p_value(difference / std::sqrt(variance))
                                           : static_cast<double>(std::abs(difference) < 1e-6));
    }
    EXPECT_GT(worst, bound) << "strategy " << static_cast<int>(strategy);
    EXPECT_NEAR(sum_mis / sum_plain, 1.0, 0.01) << "strategy " << static_cast<int>(strategy);
  }
}

TEST(path_tracer, weighing_both_strategies_is_quieter_than_either) {
  const Room room(BsdfModel::kPrincipled);
  glm::dvec3 variance(0.0);
  for (int y = 0; y < room.camera.height; ++y)
    for (int x = 0; x < room.camera.width; ++x) {
      const Ray ray = room.camera.ray(vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
      const uint64_t seed = 80 + static_cast<uint64_t>(y * 100 + x);
      PathOptions options;
      options.max_depth = 1;
      const auto error2 = [](const Estimate& e) { return e.error.x * e.error.x; };
      variance[0] += error2(
          estimate(200, seed, [&](RandomStream& r) { return trace_path(room.scene, ray, options, r); }));
      variance[1] += error2(estimate(200, seed, [&](RandomStream& r) {
        return trace_plain(room.scene, ray, 1, Strategy::kBsdfOnly, r);
      }));
      variance[2] += error2(estimate(200, seed, [&](RandomStream& r) {
        return trace_plain(room.scene, ray, 1, Strategy::kLightOnly, r);
      }));
    }
  EXPECT_LT(variance[0], variance[1]);
  EXPECT_LT(variance[0], variance[2]);
}

TEST(path_tracer, roulette_changes_no_mean) {
  const Room room(BsdfModel::kGltf);
  const Ray ray = room.camera.ray({8.0f, 8.0f});
  PathOptions early, never;
  early.roulette_depth = 1, never.roulette_depth = 100;
  early.max_depth = never.max_depth = 6;
  const Estimate a =
      estimate(20000, 90, [&](RandomStream& r) { return trace_path(room.scene, ray, early, r); });
  const Estimate b =
      estimate(20000, 91, [&](RandomStream& r) { return trace_path(room.scene, ray, never, r); });
  for (int c = 0; c < 3; ++c)
    EXPECT_GT(test::normal_p_value((a.mean[c] - b.mean[c]) / std::hypot(a.error[c], b.error[c])),
              test::sidak_bound(3));
}

TEST(path_tracer, renders_are_equal_bit_for_bit_whatever_the_threads) {
  const Room room(BsdfModel::kGltf);
  PathOptions options;
  options.samples_per_pixel = 8;
  set_num_threads(1);
  const Render one = render(room.scene, room.camera, options);
  set_num_threads(2);
  const Render two = render(room.scene, room.camera, options);
  set_num_threads(0);
  EXPECT_EQ(one.radiance.pixels, two.radiance.pixels);
  EXPECT_EQ(one.coverage.pixels, two.coverage.pixels);
  options.seed = 1;
  EXPECT_NE(render(room.scene, room.camera, options).radiance.pixels, one.radiance.pixels);
}

TEST(path_tracer, environment_behind_is_shown_on_request_only) {
  const std::vector<Part> parts{{test::sphere(vec3(0.0f), 0.5f, 16), kMatte}};
  const asset::Asset asset = test::make_asset(parts);
  const Scene scene(asset, test::make_maps(parts), constant_environment({1.0f, 2.0f, 3.0f}));
  const Camera camera = look_at({0, 0, 3}, {0, 0, 0}, 0.7f, 16, 16);
  PathOptions options;
  options.samples_per_pixel = 16;
  const Render hidden = render(scene, camera, options);
  EXPECT_EQ(hidden.radiance.rgb(0, 0), vec3(0.0f));
  EXPECT_EQ(hidden.coverage.at(0, 0)[0], 0.0f);
  EXPECT_EQ(hidden.coverage.at(8, 8)[0], 1.0f);
  options.show_environment = true;
  const Render shown = render(scene, camera, options);
  EXPECT_EQ(shown.radiance.rgb(0, 0), vec3(1.0f, 2.0f, 3.0f));
  EXPECT_EQ(shown.coverage.pixels, hidden.coverage.pixels);
}

TEST(path_tracer, reports_every_row_and_stops_when_asked) {
  const Room room(BsdfModel::kGltf);
  PathOptions options;
  options.samples_per_pixel = 1;
  std::vector<double> done;
  Progress progress;
  progress.on_update = [&](std::string_view task, double d, double total) {
    EXPECT_EQ(task, "views");
    EXPECT_EQ(total, 14.0);
    done.push_back(d);
  };
  render(room.scene, room.camera, options, progress, "views");
  ASSERT_EQ(done.size(), 14u);
  for (size_t i = 0; i < done.size(); ++i) EXPECT_EQ(done[i], static_cast<double>(i + 1));
  progress.stop_requested = [] { return true; };
  EXPECT_THROW(render(room.scene, room.camera, options, progress, "views"), Error);
}

TEST(path_tracer, even_samples_vary_less_than_independent_ones) {
  const Room room(BsdfModel::kGltf);
  PathOptions options;
  options.samples_per_pixel = 32;
  constexpr int kRepeats = 24;
  const size_t n = static_cast<size_t>(room.camera.width * room.camera.height);
  std::vector<double> sum(n), squares(n);
  double stated = 0, observed = 0;
  for (int k = 0; k < kRepeats; ++k) {
    options.seed = 100 + static_cast<uint64_t>(k);
    const Render result = render(room.scene, room.camera, options);
    const Image variance_of_mean = variance_of_means(room.scene, room.camera, options);
    for (size_t i = 0; i < n; ++i) {
      const double value = result.radiance.pixels[3 * i];
      sum[i] += value, squares[i] += value * value;
      stated += variance_of_mean.pixels[3 * i] / kRepeats;
    }
  }
  for (size_t i = 0; i < n; ++i) observed += (squares[i] - sum[i] * sum[i] / kRepeats) / (kRepeats - 1);
  EXPECT_GT(stated / observed, 1.5);
}

}  // namespace
}  // namespace patina::render
