// Assets made by others render to finite pictures of plausible brightness, whatever their size and material
// modes.
#include <gtest/gtest.h>

#include "../support.h"
#include "patina/render/path_tracer.h"

namespace patina::render {
namespace {

TEST(real_assets, render_finite_and_plausible) {
  for (const char* name :
       {"Suzanne/Suzanne.gltf", "Fox/Fox.glb", "AlphaBlendModeTest/AlphaBlendModeTest.gltf",
        "BoxVertexColors/BoxVertexColors.glb", "NegativeScaleTest/NegativeScaleTest.glb"}) {
    const auto relative = std::filesystem::path("assets") / name;
    PATINA_REQUIRE_SHARED(relative);
    const asset::Asset asset = asset::read_asset(patina::test::shared_dir() / relative);
    const asset::Bounds bounds = asset::bounds(asset);
    for (const BsdfModel model : {BsdfModel::kGltf, BsdfModel::kPrincipled}) {
      const Scene scene(asset, asset::resolve_materials(asset), studio_environment(), nullptr, {model});
      const Camera camera =
          look_at(bounds.center() + 3.0f * bounds.radius() * glm::normalize(vec3(0.5f, 0.4f, 1.0f)),
                  bounds.center(), 0.7f, 24, 24);
      PathOptions options;
      options.samples_per_pixel = 8;
      const Render result = render(scene, camera, options);
      double sum = 0, covered = 0;
      for (size_t i = 0; i < result.coverage.pixels.size(); ++i) {
        const vec3 value(result.radiance.pixels[3 * i], result.radiance.pixels[3 * i + 1],
                         result.radiance.pixels[3 * i + 2]);
        ASSERT_TRUE(is_finite(value)) << name;
        ASSERT_GE(std::min({value.x, value.y, value.z}), 0.0f) << name;
        sum += luminance(value);
        covered += result.coverage.pixels[i];
      }
      EXPECT_GT(covered, 0.02 * 24 * 24) << name;
      EXPECT_GT(sum / covered, 0.02) << name;
      EXPECT_LT(sum / covered, 5.0) << name;
    }
  }
}

}  // namespace
}  // namespace patina::render
