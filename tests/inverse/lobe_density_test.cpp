// Densities of the lobes that incident directions are drawn from, against the renderer's own.
#include "patina/inverse/lobe_density.h"

#include <gtest/gtest.h>

#include "patina/base/random.h"
#include "patina/render/bsdf.h"
#include "patina/render/microfacet.h"

namespace patina::test {
namespace {

vec3 random_direction(RandomStream& random) {
  const float z = 1.0f - 2.0f * random.uniform(), azimuth = 2.0f * kPi * random.uniform();
  const float r = std::sqrt(std::max(0.0f, 1.0f - z * z));
  return {r * std::cos(azimuth), r * std::sin(azimuth), z};
}

TEST(lobe_density, is_that_of_the_renderers_lobes) {
  RandomStream random(1, RandomPurpose::kTest, 40);
  for (const float roughness : {0.1f, 0.4f, 1.0f})
    for (int turn = 0; turn < 20; ++turn) {
      inverse::LobeMixture mixture;
      mixture.n = random_direction(random);
      mixture.wo = random_direction(random);
      mixture.num_cosine = 2, mixture.num_narrow = 3, mixture.num_wide = 1;
      mixture.alpha_narrow = render::alpha_from_roughness(roughness);
      mixture.alpha_wide = render::alpha_from_roughness(0.5f);
      inverse::DirectionArrays directions;
      directions.resize(37);
      for (size_t i = 0; i < directions.size(); ++i) directions.set(i, random_direction(random));
      std::vector<float> density;
      inverse::lobe_densities(mixture, directions, density);

      const Basis basis = orthonormal_basis(mixture.n);
      const auto local = [&](const vec3& v) {
        return vec3(glm::dot(v, basis.tangent), glm::dot(v, basis.bitangent), glm::dot(v, mixture.n));
      };
      for (size_t i = 0; i < directions.size(); ++i) {
        const vec3 wo = local(mixture.wo), wi = local(directions[i]);
        // A white metal has the specular lobe alone.
        const auto mirror = [&](float of_roughness) {
          return render::pdf_bsdf(render::BsdfModel::kGltf, {vec3(1.0f), of_roughness, 1.0f}, wo, wi);
        };
        const float expected = 2.0f * std::max(wi.z, 0.0f) * kInvPi + 3.0f * mirror(roughness) + mirror(0.5f);
        EXPECT_NEAR(density[i], expected, 1e-4f * (1.0f + expected))
            << roughness << " " << wo.z << " " << wi.z;
      }
    }
}

}  // namespace
}  // namespace patina::test
