// The reflection models: known values, symmetry, energy, and that sampling and evaluation describe the same
// function.
#include "patina/render/bsdf.h"

#include <gtest/gtest.h>

#include "patina/base/random.h"
#include "patina/render/microfacet.h"
#include "statistics.h"

namespace patina::render {
namespace {

constexpr BsdfModel kModels[] = {BsdfModel::kGltf, BsdfModel::kPrincipled};

vec3 random_upper(RandomStream& random) {
  const float z = 0.02f + 0.98f * random.uniform(), azimuth = 2.0f * kPi * random.uniform();
  const float r = std::sqrt(1.0f - z * z);
  return {r * std::cos(azimuth), r * std::sin(azimuth), z};
}

BsdfParams random_params(RandomStream& random) {
  BsdfParams params;
  params.base_color = vec3(random.uniform(), random.uniform(), random.uniform());
  params.roughness = random.uniform();
  params.metallic = random.uniform();
  return params;
}

vec3 tilted(float degrees) {
  return {std::sin(glm::radians(degrees)), 0.0f, std::cos(glm::radians(degrees))};
}

/// Reflected share of light that comes from everywhere, by quadrature.
double albedo(BsdfModel model, const BsdfParams& params, const vec3& wo, int channel) {
  return test::integrate_hemisphere(
      [&](const vec3& wi) { return eval_bsdf(model, params, wo, wi)[channel]; });
}

TEST(bsdf, gltf_equals_the_formulas_of_the_specification) {
  // [glTF2, App. B.2 and B.3] written out in double with the spec's own terms, base color 0.2, metallic m.
  const double base = 0.2;
  for (const double roughness : {0.3, 0.8})
    for (const double m : {0.0, 0.35, 1.0}) {
      const vec3 v = tilted(40.0f), l = glm::normalize(vec3(-0.3f, 0.4f, 0.7f)), h = glm::normalize(v + l);
      const double alpha2 = std::pow(roughness, 4), n_h = h.z, v_h = glm::dot(v, h);
      const double d = alpha2 / (std::numbers::pi * std::pow(n_h * n_h * (alpha2 - 1) + 1, 2));
      const auto g1 = [&](double cosine) {
        return 2 * cosine / (cosine + std::sqrt(alpha2 + (1 - alpha2) * cosine * cosine));
      };
      const double specular = d * g1(l.z) * g1(v.z) / (4 * l.z * v.z);
      const double schlick = std::pow(1 - v_h, 5);
      const double metal = specular * (base + (1 - base) * schlick);
      const double fresnel = 0.04 + 0.96 * schlick;
      const double dielectric = (1 - fresnel) * base / std::numbers::pi + fresnel * specular;
      const double expected = ((1 - m) * dielectric + m * metal) * l.z;
      const BsdfParams params{vec3(0.2f), static_cast<float>(roughness), static_cast<float>(m)};
      EXPECT_NEAR(eval_bsdf(BsdfModel::kGltf, params, v, l).x, expected, 1e-5 * expected);
    }
}

TEST(bsdf, principled_diffuse_is_lambert_with_burleys_retro_reflection) {
  // At equal directions θd = 0, so FD90 = 0.5 + 2 roughness; the specular lobe is Fresnel 0.04 of a rough
  // microfacet lobe.
  const vec3 v = tilted(60.0f);
  const BsdfParams white{vec3(1.0f), 1.0f, 0.0f}, black{vec3(0.0f), 1.0f, 0.0f};
  const float diffuse =
      eval_bsdf(BsdfModel::kPrincipled, white, v, v).x - eval_bsdf(BsdfModel::kPrincipled, black, v, v).x;
  const float retro = 1.0f + 1.5f * std::pow(0.5f, 5.0f);
  EXPECT_NEAR(diffuse, retro * retro * kInvPi * 0.5f, 1e-5f);
  // At normal incidence and exitance FD is 1: plain Lambert.
  const vec3 n(0, 0, 1);
  EXPECT_NEAR(
      eval_bsdf(BsdfModel::kPrincipled, white, n, n).x - eval_bsdf(BsdfModel::kPrincipled, black, n, n).x,
      kInvPi, 1e-5f);
}

TEST(bsdf, is_reciprocal) {
  RandomStream random(11, RandomPurpose::kTest, 0);
  for (const BsdfModel model : kModels)
    for (int i = 0; i < 2000; ++i) {
      const BsdfParams params = random_params(random);
      const vec3 a = random_upper(random), b = random_upper(random);
      const vec3 forward = eval_bsdf(model, params, a, b) / b.z,
                 backward = eval_bsdf(model, params, b, a) / a.z;
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(forward[c], backward[c], 1e-4f * forward[c] + 1e-7f);
    }
}

TEST(bsdf, is_zero_below_the_surface_and_finite_above) {
  RandomStream random(12, RandomPurpose::kTest, 0);
  for (const BsdfModel model : kModels)
    for (int i = 0; i < 2000; ++i) {
      BsdfParams params = random_params(random);
      if (i % 3 == 0) params.roughness = 0.0f;
      if (i % 5 == 0) params.base_color = vec3(0.0f);
      vec3 a = random_upper(random), b = random_upper(random);
      if (i % 4 == 0) a = glm::normalize(vec3(a.x, a.y, 1e-6f));  // grazing
      if (i % 6 == 0) b = vec3(-a.x, -a.y, a.z);                  // the peak of the lobe
      const vec3 value = eval_bsdf(model, params, a, b);
      ASSERT_TRUE(is_finite(value));
      ASSERT_GE(std::min({value.x, value.y, value.z}), 0.0f);
      ASSERT_TRUE(std::isfinite(pdf_bsdf(model, params, a, b)));
      b.z = -b.z;
      EXPECT_EQ(eval_bsdf(model, params, a, b), vec3(0.0f));
      EXPECT_EQ(pdf_bsdf(model, params, a, b), 0.0f);
      EXPECT_EQ(eval_bsdf(model, params, b, a), vec3(0.0f));
      const BsdfSample sample = sample_bsdf(model, params, a, random.uniform(), random.uniform2());
      if (sample.pdf > 0.0f) {
        ASSERT_TRUE(is_finite(sample.weight));
        ASSERT_GT(sample.wi.z, 0.0f);
      }
      EXPECT_EQ(sample_bsdf(model, params, b, random.uniform(), random.uniform2()).pdf, 0.0f);
    }
}

TEST(bsdf, gltf_metals_conserve_energy) {
  for (const float roughness : {0.1f, 0.3f, 0.6f, 1.0f})
    for (const float angle : {0.0f, 40.0f, 70.0f, 88.0f})
      EXPECT_LE(albedo(BsdfModel::kGltf, {vec3(1.0f), roughness, 1.0f}, tilted(angle), 0), 1.0 + 1e-3)
          << roughness << " " << angle;
}

/// Reflected share of uniform light, averaged over all directions of view.
double mean_albedo(BsdfModel model, const BsdfParams& params) {
  constexpr int kSteps = 12;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {  // equal steps of sin²θ
    const float cosine = std::sqrt(1.0f - (static_cast<float>(i) + 0.5f) / kSteps);
    sum += albedo(model, params, vec3(std::sqrt(1.0f - cosine * cosine), 0.0f, cosine), 0) / kSteps;
  }
  return sum;
}

TEST(bsdf, gltf_dielectrics_conserve_energy_as_far_as_the_specification_does) {
  // The specification weighs the diffuse lobe by 1 − F(V·H), as it says itself not exactly: at grazing views
  // the sharp lobe comes on top of the diffuse one. Never at normal view; averaged over all views by at most
  // 3 % and for white only.
  for (const float roughness : {0.1f, 0.3f, 0.6f, 1.0f}) {
    EXPECT_LE(albedo(BsdfModel::kGltf, {vec3(1.0f), roughness, 0.0f}, tilted(0.0f), 0), 1.0 + 1e-3)
        << roughness;
    EXPECT_LE(mean_albedo(BsdfModel::kGltf, {vec3(1.0f), roughness, 0.0f}), 1.04) << roughness;
    EXPECT_LE(mean_albedo(BsdfModel::kGltf, {vec3(0.9f), roughness, 0.0f}), 1.0) << roughness;
    EXPECT_GE(mean_albedo(BsdfModel::kGltf, {vec3(1.0f), roughness, 0.0f}), 0.97) << roughness;
  }
}

TEST(bsdf, principled_gains_no_more_than_burleys_diffuse_is_known_to) {
  // Burley's diffuse lobe is not weighed by 1 − F, so a white rough surface reflects a little more than all
  // light at grazing angles; metals do not, and nothing does at normal view and moderate albedo.
  for (const float roughness : {0.1f, 0.5f, 1.0f}) {
    for (const float angle : {0.0f, 40.0f, 70.0f})
      EXPECT_LE(albedo(BsdfModel::kPrincipled, {vec3(0.8f), roughness, 0.0f}, tilted(angle), 0), 1.0)
          << roughness << " " << angle;
    EXPECT_LE(albedo(BsdfModel::kPrincipled, {vec3(1.0f), roughness, 0.0f}, tilted(88.0f), 0), 1.7)
        << roughness;
    EXPECT_LE(albedo(BsdfModel::kPrincipled, {vec3(1.0f), roughness, 1.0f}, tilted(88.0f), 0), 1.0 + 1e-3)
        << roughness;
  }
}

TEST(bsdf, smooth_white_metal_reflects_everything) {
  for (const BsdfModel model : kModels)
    for (const float angle : {0.0f, 50.0f})
      EXPECT_NEAR(albedo(model, {vec3(1.0f), 0.1f, 1.0f}, tilted(angle), 0), 1.0, 0.01);
}

TEST(bsdf, mean_sample_weight_is_the_albedo) {
  uint64_t index = 0;
  for (const BsdfModel model : kModels)
    for (const float roughness : {0.02f, 0.3f, 0.9f})
      for (const float metallic : {0.0f, 0.5f, 1.0f}) {
        const BsdfParams params{vec3(0.9f, 0.5f, 0.1f), roughness, metallic};
        const vec3 wo = tilted(55.0f);
        RandomStream random(13, RandomPurpose::kTest, index++);
        glm::dvec3 sum(0.0), squares(0.0);
        constexpr int kCount = 40000;
        for (int i = 0; i < kCount; ++i) {
          const float u_lobe = random.uniform();
          const BsdfSample sample = sample_bsdf(model, params, wo, u_lobe, random.uniform2());
          const glm::dvec3 weight(sample.pdf > 0.0f ? sample.weight : vec3(0.0f));
          sum += weight;
          squares += weight * weight;
        }
        for (int c = 0; c < 3; ++c) {
          const double mean = sum[c] / kCount,
                       error = std::sqrt((squares[c] / kCount - mean * mean) / kCount);
          EXPECT_NEAR(mean, albedo(model, params, wo, c), 4.5 * error + 2e-3 * mean)
              << roughness << " " << metallic;
        }
      }
}

TEST(bsdf, weight_is_value_over_density) {
  RandomStream random(14, RandomPurpose::kTest, 0);
  for (const BsdfModel model : kModels)
    for (int i = 0; i < 1000; ++i) {
      const BsdfParams params = random_params(random);
      const vec3 wo = random_upper(random);
      const BsdfSample sample = sample_bsdf(model, params, wo, random.uniform(), random.uniform2());
      if (!(sample.pdf > 0.0f)) continue;
      const vec3 expected = eval_bsdf(model, params, wo, sample.wi) / sample.pdf;
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(sample.weight[c], expected[c], 1e-5f * expected[c]);
    }
}

TEST(bsdf, roughness_zero_is_a_narrow_lobe_and_not_a_division_by_zero) {
  const BsdfParams mirror{vec3(0.7f), 0.0f, 1.0f};
  const vec3 wo = tilted(30.0f);
  RandomStream random(15, RandomPurpose::kTest, 0);
  for (int i = 0; i < 100; ++i) {
    const BsdfSample sample = sample_bsdf(BsdfModel::kGltf, mirror, wo, 0.5f, random.uniform2());
    ASSERT_GT(sample.pdf, 0.0f);
    EXPECT_NEAR(glm::dot(sample.wi, vec3(-wo.x, -wo.y, wo.z)), 1.0f, 0.01f);
    EXPECT_NEAR(sample.weight.x, 0.7f, 0.01f);
  }
}

}  // namespace
}  // namespace patina::render
