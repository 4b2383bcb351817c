// Assets made by others render to finite pictures of plausible brightness, whatever their size and material
// modes.
#include <gtest/gtest.h>

#include "../support.h"
#include "compressed_gltf.h"
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

Image picture_of(const asset::Asset& asset) {
  const Scene scene(asset, asset::resolve_materials(asset), studio_environment());
  const asset::Bounds bounds = asset::bounds(asset);
  const Camera camera =
      look_at(bounds.center() + 3.0f * bounds.radius() * glm::normalize(vec3(0.5f, 0.4f, 1.0f)),
              bounds.center(), 0.7f, 64, 64);
  PathOptions options;
  options.samples_per_pixel = 16;
  return render(scene, camera, options).radiance;
}

float mean_difference(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(double{a.pixels[i]} - b.pixels[i]);
  return static_cast<float>(sum / static_cast<double>(a.pixels.size()));
}

TEST(real_assets, compressed_ones_look_as_they_did) {
  const auto file = patina::test::data_dir().parent_path().parent_path() / "examples/kettle.glb";
  const test::GlbParts plain = test::read_glb_parts(file);
  const Image expected = picture_of(asset::read_asset(file));
  const Image meshopt = picture_of(asset::read_asset("x.glb", glb_of(with_meshopt(plain))));
  EXPECT_LT(mean_difference(meshopt, expected), 1e-5f);  // triangles begin with another corner
  for (const bool in_order : {true, false}) {
    const Image draco = picture_of(asset::read_asset("x.glb", glb_of(with_draco(plain, in_order))));
    EXPECT_LT(mean_difference(draco, expected), 0.002f) << in_order;
  }
}

}  // namespace
}  // namespace patina::render
