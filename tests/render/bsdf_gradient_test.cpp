// Derivatives of the reflection models against central differences of the same formulas in double, at two
// steps.
#include <gtest/gtest.h>

#include "patina/base/random.h"
#include "patina/render/bsdf_models.h"

namespace patina::render {
namespace {

using glm::dvec3;

/// Base colour of one channel, roughness, metallic, normal: what eval_bsdf_gradient differentiates by.
struct Point {
  double x[6];
};

/// f · |cos θi| of one channel in double. Directions are rounded to float first, as the function under test
/// sees them.
double value_at(BsdfModel model, const Point& point, const vec3& wo, const vec3& wi) {
  const dvec3 n(point.x[3], point.x[4], point.x[5]), o(wo), i(wi), h(glm::normalize(wo + wi));
  const dvec3 n_cross_h = glm::cross(n, h);
  const ReflectionAngles<double> angles{glm::dot(n, o), glm::dot(n, i), glm::dot(n, h),
                                        glm::dot(n_cross_h, n_cross_h),
                                        glm::dot(wo, glm::normalize(wo + wi))};
  const auto factors = reflection_factors(model, point.x[1], point.x[2], angles);
  return reflection_channel(model, point.x[0], factors);
}

double central_difference(BsdfModel model, Point point, int variable, double step, const vec3& wo,
                          const vec3& wi) {
  const double x = point.x[variable];
  point.x[variable] = x + step;
  const double above = value_at(model, point, wo, wi);
  point.x[variable] = x - step;
  return (above - value_at(model, point, wo, wi)) / (2 * step);
}

TEST(bsdf_gradient, equals_central_differences_at_two_steps) {
  const char* names[] = {"base colour", "roughness", "metallic", "normal x", "normal y", "normal z"};
  RandomStream random(21, RandomPurpose::kTest, 0);
  int cases = 0;
  for (const BsdfModel model : {BsdfModel::kGltf, BsdfModel::kPrincipled})
    for (int trial = 0; trial < 40; ++trial) {
      const auto direction = [&] {
        return glm::normalize(vec3(random.gaussian(), random.gaussian(), random.gaussian()));
      };
      const vec3 n = direction();
      vec3 wo = direction(), wi = direction();
      if (glm::dot(n, wo) < 0.0f) wo = -wo;
      if (glm::dot(n, wi) < 0.0f) wi = -wi;
      if (trial % 4 == 0) wi = glm::normalize(2.0f * glm::dot(n, wo) * n - wo + 0.05f * wi);  // near the peak
      if (glm::dot(n, wo) < 0.05f || glm::dot(n, wi) < 0.05f) continue;
      BsdfParams params{vec3(random.uniform(), random.uniform(), random.uniform()),
                        0.1f + 0.9f * random.uniform(), random.uniform()};
      const BsdfGradient gradient = eval_bsdf_gradient(model, params, n, wo, wi);
      for (int c = 0; c < 3; ++c) {
        const Point point{{params.base_color[c], params.roughness, params.metallic, n.x, n.y, n.z}};
        const double derivatives[] = {gradient.d_base_color[c], gradient.d_roughness[c],
                                      gradient.d_metallic[c],   gradient.d_normal[c].x,
                                      gradient.d_normal[c].y,   gradient.d_normal[c].z};
        const double value = value_at(model, point, wo, wi);
        EXPECT_NEAR(gradient.value[c], value, 1e-4 * value + 1e-6);
        for (int variable = 0; variable < 6; ++variable) {
          const double coarse = central_difference(model, point, variable, 1e-4, wo, wi);
          const double fine = central_difference(model, point, variable, 5e-5, wo, wi);
          // The truncation error falls with the square of the step: the two steps bound it.
          const double tolerance = 2e-3 * std::abs(fine) + 5e-4 * value + 1e-5 + std::abs(coarse - fine);
          EXPECT_NEAR(derivatives[variable], coarse, tolerance) << names[variable] << " trial " << trial;
          EXPECT_NEAR(derivatives[variable], fine, tolerance) << names[variable] << " trial " << trial;
          EXPECT_LT(std::abs(coarse - fine), 0.02 * std::abs(fine) + 5e-4 * value + 1e-5)
              << "a step too large to judge by";
          ++cases;
        }
      }
    }
  EXPECT_GE(cases, 60);
}

TEST(bsdf_gradient, value_equals_eval_bsdf) {
  RandomStream random(22, RandomPurpose::kTest, 0);
  for (const BsdfModel model : {BsdfModel::kGltf, BsdfModel::kPrincipled})
    for (int trial = 0; trial < 200; ++trial) {
      const vec3 n = glm::normalize(vec3(random.gaussian(), random.gaussian(), random.gaussian()));
      const Basis basis = orthonormal_basis(n);
      const auto upper = [&] {
        return glm::normalize(vec3(random.gaussian(), random.gaussian(), 0.05f + random.uniform()));
      };
      const vec3 wo = upper(), wi = upper();
      const auto world = [&](const vec3& v) { return v.x * basis.tangent + v.y * basis.bitangent + v.z * n; };
      const BsdfParams params{vec3(0.3f, 0.6f, 0.9f), 0.2f + 0.8f * random.uniform(), random.uniform()};
      const vec3 expected = eval_bsdf(model, params, wo, wi);
      const vec3 value = eval_bsdf_gradient(model, params, n, world(wo), world(wi)).value;
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(value[c], expected[c], 2e-4f * expected[c] + 1e-6f);
    }
}

TEST(bsdf_gradient, is_zero_below_the_surface) {
  const vec3 n(0, 1, 0), up = glm::normalize(vec3(0.2f, 1, 0)), down = glm::normalize(vec3(0.2f, -1, 0));
  for (const auto& [wo, wi] : {std::pair(up, down), std::pair(down, up), std::pair(down, down)}) {
    const BsdfGradient gradient = eval_bsdf_gradient(BsdfModel::kGltf, {}, n, wo, wi);
    EXPECT_EQ(gradient.value, vec3(0.0f));
    EXPECT_EQ(gradient.d_roughness, vec3(0.0f));
    EXPECT_EQ(gradient.d_normal[0], vec3(0.0f));
  }
}

TEST(bsdf_gradient, roughness_has_no_effect_below_the_narrowest_lobe) {
  const vec3 n(0, 0, 1), wo = glm::normalize(vec3(0.5f, 0, 1)), wi(-wo.x, -wo.y, wo.z);
  const BsdfGradient gradient = eval_bsdf_gradient(BsdfModel::kGltf, {vec3(0.5f), 0.01f, 1.0f}, n, wo, wi);
  EXPECT_EQ(gradient.d_roughness, vec3(0.0f));
  EXPECT_GT(gradient.value.x, 0.0f);
}

}  // namespace
}  // namespace patina::render
