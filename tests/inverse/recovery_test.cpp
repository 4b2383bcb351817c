// The whole fit on a real asset with a known answer: WaterBottle's base colour, roughness and normals
// flattened to their means, nine path-traced views of the true ones as targets.
#include <gtest/gtest.h>

#include "recovery/recovery.h"
#include "support.h"

namespace patina::test {
namespace {

TEST(recovery, finds_the_water_bottles_textures_again) {
  PATINA_REQUIRE_SHARED("assets/WaterBottle/WaterBottle.gltf");
  RecoveryOptions options;
  options.samples_per_pixel = 64;
  const Recovery r = recover(shared_dir() / "assets/WaterBottle/WaterBottle.gltf", options);
  const MapErrors start = map_errors(r, r.start), found = map_errors(r, r.fit.maps);
  EXPECT_GE(found.base_color_psnr, 24.0) << "from " << start.base_color_psnr;
  EXPECT_LE(found.roughness_mae, 0.10) << "from " << start.roughness_mae;
  EXPECT_LT(found.normal_degrees, start.normal_degrees);
  EXPECT_GT(found.seen_share, 0.3);
}

}  // namespace
}  // namespace patina::test
