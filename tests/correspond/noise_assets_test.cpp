// The same demands on noise, on real assets: seams, mirrored and shared UVs, several materials, thin parts.
#include <gtest/gtest.h>

#include "../support.h"
#include "patina/correspond/noise.h"
#include "patina/correspond/noise_agreement.h"
#include "patina/views/view_set.h"

namespace patina::correspond {
namespace {

class NoiseOnAssets : public testing::TestWithParam<const char*> {};

TEST_P(NoiseOnAssets, exact_noise_is_white_and_reaches_the_bound) {
  const std::string relative = std::string("assets/") + GetParam();
  PATINA_REQUIRE_SHARED(relative);
  const asset::Asset asset = asset::read_asset(patina::test::shared_dir() / relative);
  const render::Scene scene(asset, asset::resolve_materials(asset), render::constant_environment(vec3(1.0f)));
  views::OrbitOptions orbit;
  orbit.num_views = 16;  // turned by 22.5°
  const auto cameras = views::orbit_cameras(asset::bounds(asset), orbit);

  std::vector<NoiseField> noises;
  for (uint64_t seed = 0; seed < 2; ++seed)
    noises.push_back(make_noise(scene, cameras, 8, {NoiseMode::kExact, 1024, seed}));
  NoiseStatistics mean;
  float smallest_p = 1, largest_autocorrelation = 0;
  constexpr float kCount = 32, kNumAssets = 6;
  for (const NoiseField& noise : noises)
    for (const NoiseStatistics& s : noise_statistics(noise, 4)) {
      mean.mean += s.mean / kCount;
      mean.variance += s.variance / kCount;
      mean.autocorrelation_x += s.autocorrelation_x / kCount;
      mean.autocorrelation_y += s.autocorrelation_y / kCount;
      smallest_p = std::min(smallest_p, s.kolmogorov_smirnov_p);
      largest_autocorrelation =
          std::max({largest_autocorrelation, std::abs(s.autocorrelation_x), std::abs(s.autocorrelation_y)});
    }
  EXPECT_NEAR(mean.mean, 0.0f, 0.02f);
  EXPECT_NEAR(mean.variance, 1.0f, 0.02f);
  EXPECT_LT(std::abs(mean.autocorrelation_x), 0.01f);
  EXPECT_LT(std::abs(mean.autocorrelation_y), 0.01f);
  EXPECT_LT(largest_autocorrelation, 0.03f + 0.008f);  // one view's own scatter is 0.008
  EXPECT_GT(smallest_p, 0.01f / (kCount * kNumAssets));  // 1 % over all views of all assets

  const NoiseAgreement agreement = noise_agreement(scene, cameras, 8, noises, 0, 1, 6);
  EXPECT_GT(agreement.num_pairs, 100);
  const double scatter = 1.0 / std::sqrt(8.0 * static_cast<double>(agreement.num_pairs)) / agreement.bound;
  EXPECT_NEAR(agreement.of_bound(), 1.0, 0.06 + 3.0 * scatter) << "bound " << agreement.bound;
}

INSTANTIATE_TEST_SUITE_P(Shared, NoiseOnAssets,
                         testing::Values("WaterBottle/WaterBottle.gltf", "Suzanne/Suzanne.gltf",
                                         "Spot/spot_triangulated.obj",
                                         "NormalTangentTest/NormalTangentTest.glb",
                                         "ClearcoatWicker/ClearcoatWicker.glb",
                                         "KayKitDungeon/barrel_large_decorated.gltf.glb"));

}  // namespace
}  // namespace patina::correspond
