// Every sampler draws from the density that it states: χ² at an overall significance of 1 %.
#include <gtest/gtest.h>

#include "patina/base/random.h"
#include "patina/render/environment.h"
#include "patina/render/lights.h"
#include "patina/render/microfacet.h"
#include "patina/render/sampling.h"
#include "patina/render/scene.h"
#include "scenes.h"
#include "statistics.h"

namespace patina::render {
namespace {

constexpr int kSamples = 60000;
constexpr BsdfModel kModels[] = {BsdfModel::kGltf, BsdfModel::kPrincipled};
constexpr float kRoughness[] = {0.05f, 0.2f, 0.5f, 1.0f};
constexpr float kAngles[] = {0.0f, 30.0f, 60.0f, 85.0f};
constexpr float kMetallic[] = {0.0f, 0.6f, 1.0f};
constexpr int kNumBsdfTests = 2 * 4 * 4 * 3;
constexpr int kNumTests =
    kNumBsdfTests + 12;  // BSDFs, then visible normals, cosine, triangle, environments, lights

vec3 direction_at(float degrees) {
  const float a = glm::radians(degrees);
  return {std::sin(a) * std::cos(0.4f), std::sin(a) * std::sin(0.4f), std::cos(a)};
}

TEST(sampler, bsdf_samples_follow_their_density) {
  const double bound = test::sidak_bound(kNumTests);
  uint64_t index = 0;
  for (const BsdfModel model : kModels)
    for (const float roughness : kRoughness)
      for (const float angle : kAngles)
        for (const float metallic : kMetallic) {
          const BsdfParams params{vec3(0.8f, 0.5f, 0.2f), roughness, metallic};
          const vec3 wo = direction_at(angle);
          RandomStream random(1, RandomPurpose::kTest, index++);
          std::vector<vec3> samples;
          int lost = 0;
          double weight = 0;
          for (int i = 0; i < kSamples; ++i) {
            const float u_lobe = random.uniform();
            const BsdfSample sample = sample_bsdf(model, params, wo, u_lobe, random.uniform2());
            if (!(sample.pdf > 0.0f)) {
              ++lost;
              continue;
            }
            samples.push_back(sample.wi);
            ASSERT_NEAR(sample.pdf / pdf_bsdf(model, params, wo, sample.wi), 1.0f, 1e-4f);
            weight += sample.weight.y;
          }
          const auto result = test::chi_squared_hemisphere(
              samples, lost, [&](const vec3& wi) { return pdf_bsdf(model, params, wo, wi); });
          EXPECT_GT(result.p_value, bound)
              << "model " << static_cast<int>(model) << " roughness " << roughness << " angle " << angle
              << " metallic " << metallic << " total " << result.total << " lost " << lost << " bins "
              << result.bins;
          EXPECT_LT(result.total, 1.0 + 2e-3);
        }
  EXPECT_EQ(index, kNumBsdfTests);
}

TEST(sampler, visible_normals_follow_their_density) {
  for (const float alpha : {0.1f, 0.5f, 1.0f}) {
    const vec3 wo = direction_at(70.0f);
    RandomStream random(2, RandomPurpose::kTest, static_cast<uint64_t>(alpha * 10));
    std::vector<vec3> samples;
    for (int i = 0; i < kSamples; ++i) samples.push_back(sample_visible_normal(alpha, wo, random.uniform2()));
    const auto pdf = [&](const vec3& h) -> double {
      const float masking = 2.0f * wo.z * smith_visibility(alpha, wo.z);
      return masking * std::max(0.0f, glm::dot(wo, h)) * ggx_distribution(alpha, h.z, h.x * h.x + h.y * h.y) /
             wo.z;
    };
    const auto result = test::chi_squared_hemisphere(samples, 0, pdf);
    EXPECT_GT(result.p_value, test::sidak_bound(kNumTests)) << "alpha " << alpha;
    EXPECT_NEAR(result.total, 1.0, 2e-3);
  }
}

TEST(sampler, cosine_samples_follow_their_density) {
  RandomStream random(3, RandomPurpose::kTest, 0);
  std::vector<vec3> samples;
  for (int i = 0; i < kSamples; ++i) samples.push_back(sample_cosine_hemisphere(random.uniform2()));
  const auto result = test::chi_squared_hemisphere(samples, 0, [](const vec3& d) { return d.z * kInvPi; });
  EXPECT_GT(result.p_value, test::sidak_bound(kNumTests));
  EXPECT_NEAR(result.total, 1.0, 1e-4);
}

TEST(sampler, triangle_samples_are_uniform_over_the_area) {
  // Cut the unit triangle into 100 strips of equal barycentric width both ways and compare with their areas.
  constexpr int kSide = 10;
  std::vector<double> observed(kSide * kSide), expected(kSide * kSide);
  RandomStream random(4, RandomPurpose::kTest, 0);
  for (int i = 0; i < kSamples; ++i) {
    const vec2 b = sample_triangle(random.uniform2());
    observed[static_cast<size_t>(static_cast<int>(b.x * kSide) * kSide + static_cast<int>(b.y * kSide))] += 1;
  }
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const double area = i + j < kSide - 1 ? 1.0 : i + j == kSide - 1 ? 0.5 : 0.0;
      expected[static_cast<size_t>(i * kSide + j)] = area * 2.0 / (kSide * kSide) * kSamples;
    }
  int bins = 0;
  const double statistic = test::chi_squared_bins(observed, expected, &bins);
  EXPECT_GT(test::chi_squared_p_value(statistic, bins - 1), test::sidak_bound(kNumTests));
}

TEST(sampler, environment_samples_follow_their_density) {
  Image uneven(16, 8, 3);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 16; ++x) uneven.set_rgb(x, y, vec3(0.1f * static_cast<float>((3 * x + 5 * y) % 7)));
  uneven.set_rgb(5, 2, vec3(40.0f, 10.0f, 3.0f));
  Image poles(8, 4, 3);  // light at the poles and nowhere else
  for (int x = 0; x < 8; ++x) poles.set_rgb(x, 0, vec3(1.0f)), poles.set_rgb(x, 3, vec3(0.5f));
  const std::pair<const char*, Environment> cases[] = {{"uneven", Environment(uneven)},
                                                       {"poles", Environment(poles)},
                                                       {"one texel", constant_environment(vec3(2.0f))},
                                                       {"black", constant_environment(vec3(0.0f))},
                                                       {"studio", studio_environment()}};
  uint64_t index = 0;
  for (const auto& [name, environment] : cases) {
    // The density is constant over a texel, so bins are texels, cut in two by polar cosine to see the inside
    // too.
    const int width = environment.map().width, height = environment.map().height;
    const auto bin = [&](int x, int y, bool upper) {
      return static_cast<size_t>((y * width + x) * 2 + upper);
    };
    const auto row_cosine = [&](int y) { return std::cos(std::numbers::pi * y / height); };
    std::vector<double> observed(static_cast<size_t>(width) * static_cast<size_t>(height) * 2),
        expected(observed.size());

    RandomStream random(5, RandomPurpose::kTest, index++);
    double mean = 0;
    for (int i = 0; i < kSamples; ++i) {
      const Environment::Sample sample = environment.sample(random.uniform2());
      const vec3 d = sample.direction;
      ASSERT_GT(sample.pdf, 0.0f);
      ASSERT_NEAR(glm::length(d), 1.0f, 1e-5f);
      const double u =
          0.5 + std::atan2(static_cast<double>(d.z), static_cast<double>(d.x)) / (2 * std::numbers::pi);
      const double v = std::acos(std::clamp(static_cast<double>(d.y), -1.0, 1.0)) / std::numbers::pi;
      const int x = std::clamp(static_cast<int>(u * width), 0, width - 1),
                y = std::clamp(static_cast<int>(v * height), 0, height - 1);
      observed[bin(x, y, d.y > 0.5 * (row_cosine(y) + row_cosine(y + 1)))] += 1;
      mean += luminance(sample.radiance) / sample.pdf / kSamples;
    }

    double total = 0, exact_mean = 0;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const double solid_angle = 2 * std::numbers::pi / width * (row_cosine(y) - row_cosine(y + 1));
        const auto at = [&](double dx, double dy) {
          const double azimuth = 2 * std::numbers::pi * ((x + dx) / width - 0.5);
          const double z = row_cosine(y) + dy * (row_cosine(y + 1) - row_cosine(y)), r = std::sqrt(1 - z * z);
          return vec3(glm::dvec3(r * std::cos(azimuth), z, r * std::sin(azimuth)));
        };
        const double mass = environment.pdf(at(0.5, 0.5)) * solid_angle;
        EXPECT_NEAR(environment.pdf(at(0.9, 0.1)) * solid_angle, mass, 1e-5 * mass);
        for (const bool upper : {false, true}) expected[bin(x, y, upper)] = 0.5 * mass * kSamples;
        total += mass;
        constexpr int kSide = 4;
        for (int i = 0; i < kSide * kSide; ++i)
          exact_mean +=
              luminance(environment.radiance(at((i % kSide + 0.5) / kSide, (i / kSide + 0.5) / kSide))) *
              solid_angle / (kSide * kSide);
      }
    int bins = 0;
    const double statistic = test::chi_squared_bins(observed, expected, &bins);
    EXPECT_GT(test::chi_squared_p_value(statistic, bins - 1), test::sidak_bound(kNumTests))
        << name << " " << bins;
    EXPECT_NEAR(total, 1.0, 1e-4) << name;
    EXPECT_NEAR(mean, exact_mean, 0.02 * exact_mean) << name;
  }
}

TEST(sampler, environment_density_is_positive_wherever_there_is_light) {
  // A single bright texel: the bilinear look-up spreads it over its neighbours, which must all be sampled.
  Image map(32, 16, 3);
  map.set_rgb(0, 4, vec3(1.0f));
  const Environment environment(map);
  RandomStream random(6, RandomPurpose::kTest, 0);
  int lit = 0;
  for (int i = 0; i < kSamples; ++i) {
    const float z = 1.0f - 2.0f * random.uniform(), azimuth = 2.0f * kPi * random.uniform();
    const float r = std::sqrt(1.0f - z * z);
    const vec3 d(r * std::cos(azimuth), z, r * std::sin(azimuth));
    if (!(environment.radiance(d).x > 0.0f)) continue;
    ++lit;
    EXPECT_GT(environment.pdf(d), 0.0f);
  }
  EXPECT_GT(lit, 100);
}

TEST(sampler, light_samples_follow_their_density) {
  // Two emitting squares of unlike power, and a sky: how often each is chosen, where on it, and the density
  // that is stated.
  constexpr float kPower[] = {4.0f * 3.0f, 3.0f * (3.5f / 3.0f)};  // area times mean radiance
  const vec3 corner[] = {{-1, 2, -1}, {2, -1, -1}}, side_a[] = {{2, 0, 0}, {0, 0, 1.5f}},
             side_b[] = {{0, 0, 2}, {0, 2, 0}};
  const std::vector<test::Part> parts{
      {test::quad(corner[0], side_a[0], side_b[0]), {.emission = vec3(3.0f)}},
      {test::quad(corner[1], side_a[1], side_b[1]), {.emission = vec3(1.0f, 2.0f, 0.5f)}},
      {test::floor(1.0f, -1.0f), {}}};
  const asset::Asset asset = test::make_asset(parts);
  const vec3 p(0.2f, 0.1f, -0.1f);
  uint64_t index = 0;
  for (const float sky : {0.0f, 0.5f}) {
    const Scene scene(asset, test::make_maps(parts), constant_environment(vec3(sky)));
    const Lights& lights = scene.light_sampler();
    const double sky_share = 4 * std::numbers::pi * lights.pdf_environment(vec3(0, 1, 0));
    EXPECT_EQ(sky_share > 0, sky > 0);
    constexpr int kSide = 6;
    std::vector<double> observed(2 * kSide * kSide + 1), expected(observed.size());
    for (size_t q = 0; q < 2; ++q)
      for (size_t i = 0; i < kSide * kSide; ++i)
        expected[q * kSide * kSide + i] =
            (1 - sky_share) * kPower[q] / (kPower[0] + kPower[1]) / (kSide * kSide) * kSamples;
    expected.back() = sky_share * kSamples;

    RandomStream random(7, RandomPurpose::kTest, index++);
    for (int i = 0; i < kSamples; ++i) {
      const float u_light = random.uniform();
      const auto sample = lights.sample_extended(p, u_light, random.uniform2());
      ASSERT_TRUE(sample.has_value());
      if (sample->at_infinity) {
        observed.back() += 1;
        ASSERT_FLOAT_EQ(sample->pdf, lights.pdf_environment(sample->direction));
        continue;
      }
      const size_t q = sample->p_light.y > 1.999f ? 0 : 1;
      const vec3 local = sample->p_light - corner[q];
      const auto cell = [&](const vec3& side) {
        return static_cast<size_t>(
            glm::clamp(static_cast<int>(glm::dot(local, side) / glm::dot(side, side) * kSide), 0, kSide - 1));
      };
      observed[q * kSide * kSide + cell(side_a[q]) * kSide + cell(side_b[q])] += 1;
      if (i % 100 != 0) continue;
      // What a path that hits the light by chance computes for the same point.
      Ray ray{p, sample->direction};
      const auto hit = scene.intersect(ray);
      ASSERT_TRUE(hit.has_value());
      const SurfacePoint point = scene.surface(ray, *hit);
      ASSERT_NEAR(glm::length(point.p_world - sample->p_light), 0.0f, 1e-4f);
      const float pdf =
          lights.pdf_triangle(hit->primitive, hit->triangle, ray.direction, hit->t, point.n_geometric);
      ASSERT_NEAR(pdf / sample->pdf, 1.0f, 1e-3f);
      const double area = glm::length(side_a[q]) * glm::length(side_b[q]);
      const double exact = (1 - sky_share) * kPower[q] / (kPower[0] + kPower[1]) / area * hit->t * hit->t /
                           std::abs(glm::dot(ray.direction, point.n_geometric));
      ASSERT_NEAR(pdf / exact, 1.0, 1e-3);
    }
    int bins = 0;
    const double statistic = test::chi_squared_bins(observed, expected, &bins);
    EXPECT_GT(test::chi_squared_p_value(statistic, bins - 1), test::sidak_bound(kNumTests)) << "sky " << sky;
  }
}

}  // namespace
}  // namespace patina::render
