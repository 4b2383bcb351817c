// The same demands on noise, on real assets: seams, mirrored and shared UVs, several materials, thin parts.
#include <algorithm>

#include <gtest/gtest.h>

#include "../support.h"
#include "patina/correspond/footprint.h"
#include "patina/correspond/noise.h"
#include "patina/correspond/noise_agreement.h"
#include "patina/views/view_set.h"

namespace patina::correspond {
namespace {

namespace fs = std::filesystem;

render::Scene scene_of(const asset::Asset& asset) {
  return render::Scene(asset, asset::resolve_materials(asset), render::constant_environment(vec3(1.0f)));
}

std::vector<fs::path> asset_files() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(patina::test::shared_dir() / "assets")) {
    const fs::path extension = entry.path().extension();
    if (extension == ".gltf" || extension == ".glb" || extension == ".obj") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

bool has_uvs(const asset::Asset& asset) {
  return std::any_of(asset.primitives.begin(), asset.primitives.end(),
                     [](const asset::Primitive& p) { return !p.uv.empty() && !p.uv[0].empty(); });
}

// Over all views and seeds, on the surface alone.
void expect_white(const render::Scene& scene, const std::vector<render::Camera>& cameras) {
  constexpr std::array<uint64_t, 4> kSeeds{0, 1, 2, 3};
  const auto mask = surface_mask(scene, cameras, 8);
  double count = 0, mean = 0, variance = 0, along_x = 0, along_y = 0;
  float smallest_p = 1;
  for (const NoiseField& noise : make_noises(scene, cameras, 8, {.mode = NoiseMode::kExact}, kSeeds))
    for (const NoiseStatistics& s : noise_statistics(noise, views::grid_of(cameras.size()), mask)) {
      const auto n = static_cast<double>(s.num_values);
      count += n;
      mean += n * static_cast<double>(s.mean);
      // About the mean of the view, which takes one of its n degrees of freedom.
      variance += n > 1 ? n * n / (n - 1) * static_cast<double>(s.variance) : 0.0;
      along_x += n * static_cast<double>(s.autocorrelation_x);
      along_y += n * static_cast<double>(s.autocorrelation_y);
      if (n > 0) smallest_p = std::min(smallest_p, s.kolmogorov_smirnov_p);
    }
  ASSERT_GT(count, 4000.0);
  // Views share numbers, so there are fewer independent ones than values; half of them is on the safe side.
  const double deviation = 1.0 / std::sqrt(0.5 * count);
  EXPECT_NEAR(mean / count, 0.0, std::max(0.02, 4.0 * deviation));
  EXPECT_NEAR(variance / count, 1.0, std::max(0.02, 4.0 * std::numbers::sqrt2 * deviation));
  EXPECT_NEAR(along_x / count, 0.0, std::max(0.02, 4.0 * deviation));
  EXPECT_NEAR(along_y / count, 0.0, std::max(0.02, 4.0 * deviation));
  EXPECT_GT(smallest_p, 0.01 / (16.0 * 40.0));  // 1 % over 16 views of 40 assets
}

TEST(NoiseOnAssets, exact_noise_is_white_on_every_asset_with_uvs) {
  PATINA_REQUIRE_SHARED("assets");
  int measured = 0;
  for (const fs::path& file : asset_files()) {
    SCOPED_TRACE(file.string());
    const asset::Asset asset = asset::read_asset(file);
    if (!has_uvs(asset)) continue;
    views::OrbitOptions orbit;
    orbit.num_views = 4;
    expect_white(scene_of(asset), views::orbit_cameras(asset::bounds(asset), orbit));
    ++measured;
  }
  EXPECT_GE(measured, 30);
}

class NoiseOnAsset : public testing::TestWithParam<const char*> {};

TEST_P(NoiseOnAsset, exact_noise_reaches_the_bound) {
  const std::string relative = std::string("assets/") + GetParam();
  PATINA_REQUIRE_SHARED(relative);
  const asset::Asset asset = asset::read_asset(patina::test::shared_dir() / relative);
  const render::Scene scene = scene_of(asset);
  views::OrbitOptions orbit;
  orbit.num_views = 16;  // turned by 22.5°, of which neighbours are compared
  auto cameras = views::orbit_cameras(asset::bounds(asset), orbit);
  cameras.resize(4);
  const auto noises =
      make_noises(scene, cameras, 8, {.mode = NoiseMode::kExact}, std::array<uint64_t, 4>{0, 1, 2, 3});
  double correlation = 0, bound = 0, pairs = 0;
  for (const int view : {0, 1, 2}) {
    const NoiseAgreement agreement = noise_agreement(scene, cameras, 8, noises, view, view + 1);
    correlation += agreement.correlation * static_cast<double>(agreement.num_pairs);
    bound += agreement.bound * static_cast<double>(agreement.num_pairs);
    pairs += static_cast<double>(agreement.num_pairs);
  }
  ASSERT_GT(pairs, 300.0);
  const double deviation = std::sqrt(pairs / 16.0) / bound;
  EXPECT_NEAR(correlation / bound, 1.0, 0.03 + 3.0 * deviation);
}

INSTANTIATE_TEST_SUITE_P(Shared, NoiseOnAsset,
                         testing::Values("WaterBottle/WaterBottle.gltf", "Suzanne/Suzanne.gltf",
                                         "Spot/spot_triangulated.obj",
                                         "NormalTangentTest/NormalTangentTest.glb",
                                         "ClearcoatWicker/ClearcoatWicker.glb",
                                         "KayKitDungeon/barrel_large_decorated.gltf.glb"));

}  // namespace
}  // namespace patina::correspond
