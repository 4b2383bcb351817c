// Real assets by others, against the figures that their README states (made with other tools).
#include <algorithm>

#include <gtest/gtest.h>

#include "patina/asset/asset.h"
#include "patina/asset/geometry.h"
#include "patina/asset/material_maps.h"
#include "patina/base/error.h"
#include "support.h"

namespace patina::asset {
namespace {

struct Figures {
  const char* path;
  size_t triangles;
  size_t materials;
  float overlap, mirrored,
      zero_area;  // worst material, as the README rounds it (percent); negative: not stated
};

void PrintTo(const Figures& f, std::ostream* out) {
  *out << f.path;
}

class SharedAsset : public testing::TestWithParam<Figures> {};

TEST_P(SharedAsset, has_the_stated_triangles_materials_and_uv_figures) {
  const Figures& expected = GetParam();
  PATINA_REQUIRE_SHARED(std::filesystem::path("assets") / expected.path);
  const Asset asset = read_asset(test::shared_dir() / "assets" / expected.path);
  size_t triangles = 0;
  for (const Primitive& p : asset.primitives) {
    triangles += p.triangles.size();
    ASSERT_EQ(p.n_world.size(), p.p_world.size());
    if (!p.tangent_world.empty()) {
      ASSERT_EQ(p.tangent_world.size(), p.p_world.size());
    }
    EXPECT_LT(p.material, static_cast<int>(asset.materials.size()));
    for (const vec3& n : p.n_world) ASSERT_NEAR(glm::length(n), 1.0f, 1e-4f);
    for (size_t i = 0; i < p.tangent_world.size(); ++i)
      ASSERT_NEAR(glm::length(vec3(p.tangent_world[i])), 1.0f, 1e-4f);
    const Material& material = asset.materials[static_cast<size_t>(p.material)];
    if (material.normal && !p.uv.empty()) {
      EXPECT_FALSE(p.tangent_world.empty());
    }
  }
  EXPECT_EQ(triangles, expected.triangles);
  EXPECT_EQ(asset.materials.size(), expected.materials);

  float overlap = 0, mirrored = 0, zero_area = 0;
  for (const UvState& state : uv_states(asset)) {
    overlap = std::max(overlap, 100 * state.overlapping);
    mirrored = std::max(mirrored, 100 * state.mirrored);
    zero_area = std::max(zero_area, 100 * state.zero_area);
  }
  // The README counts a mesh's UVs once and as stored; patina counts each instance, wound as it is seen. So a
  // mesh that stands twice overlaps (TextureTransformTest), and mirrored instances wind otherwise
  // (NegativeScaleTest); those two figures are left out. Under one percent the README says nothing; otherwise
  // it rounds to whole percents. Which texel an edge belongs to is a matter of the rasteriser, so overlaps
  // may differ by two points.
  const auto check = [](float found, float stated, float tolerance, const char* what) {
    if (stated < 0) return;
    if (stated == 0) {
      EXPECT_LT(found, 1.0f + tolerance) << what;
    } else {
      EXPECT_NEAR(found, stated, tolerance + 0.6f) << what;
    }
  };
  check(overlap, expected.overlap, 2.0f, "overlap");
  check(mirrored, expected.mirrored, 0.5f, "mirrored");
  check(zero_area, expected.zero_area, 0.5f, "zero area");
}

INSTANTIATE_TEST_SUITE_P(
    Readme, SharedAsset,
    testing::Values(Figures{"WaterBottle/WaterBottle.gltf", 4510, 1, 0, 2, 2},
                    Figures{"BoomBoxWithAxes/BoomBoxWithAxes.gltf", 16688, 2, 100, 39, 18},
                    Figures{"MaterialsVariantsShoe/MaterialsVariantsShoe.gltf", 22700, 3, 0, 0, 0},
                    Figures{"ToyCar/ToyCar.gltf", 108936, 3, 0, 0, 0},
                    Figures{"IridescentDishWithOlives/IridescentDishWithOlives.gltf", 24448, 4, 0, 0, 8},
                    Figures{"GlamVelvetSofa/GlamVelvetSofa.glb", 4196, 7, 0, 0, 0},
                    Figures{"SheenCloth/SheenCloth.gltf", 115200, 1, 0, 0, 0},
                    Figures{"Suzanne/Suzanne.gltf", 3936, 1, 0, 0, 0},
                    Figures{"LightsPunctualLamp/LightsPunctualLamp.gltf", 6000, 3, 0, 0, 0},
                    Figures{"Fox/Fox.glb", 576, 1, 0, 0, 0},
                    Figures{"ClearcoatWicker/ClearcoatWicker.glb", 3072, 1, 100, 0, 0},
                    Figures{"KayKitDungeon/barrel_large_decorated.gltf.glb", 1047, 1, 97, 38, 23},
                    Figures{"KayKitDungeon/chest.glb", 728, 1, 98, 24, 34},
                    Figures{"KayKitDungeon/obj/barrel_large.obj", 561, 1, 90, 39, 20},
                    Figures{"KayKitDungeon/table_long_decorated_A.gltf.glb", 1961, 1, 97, 38, 24},
                    Figures{"KayKitDungeon/wall_cracked.gltf.glb", 2010, 1, 98, 48, 4},
                    Figures{"KenneyPlatformer/block-coin.glb", 788, 1, 0, 0, 100},
                    Figures{"KenneyPlatformer/character.glb", 550, 1, 0, 0, 100},
                    Figures{"Spot/spot_control_mesh.obj", 372, 1, 0, 4, 0},
                    Figures{"Spot/spot_quadrangulated.obj", 5856, 1, 0, 3, 0},
                    Figures{"Spot/spot_triangulated.obj", 5856, 1, 0, 3, 0},
                    Figures{"AlphaBlendModeTest/AlphaBlendModeTest.gltf", 61, 6, 0, 0, 0},
                    Figures{"NormalTangentTest/NormalTangentTest.glb", 7774, 1, 0, 0, 0},
                    Figures{"MultiUVTest/MultiUVTest.glb", 12, 1, 0, 0, 0},
                    Figures{"TextureTransformTest/TextureTransformTest.gltf", 24, 9, -1, 0, 0},
                    Figures{"TextureCoordinateTest/TextureCoordinateTest.glb", 10, 5, 0, 0, 0},
                    Figures{"TextureSettingsTest/TextureSettingsTest.glb", 72, 10, 98, 50, 0},
                    Figures{"TextureEncodingTest/TextureEncodingTest.glb", 3844, 14, 0, 0, 0},
                    Figures{"BoxWithSpaces/Box With Spaces.gltf", 12, 1, 100, 0, 0},
                    Figures{"BoxVertexColors/BoxVertexColors.glb", 12, 1, -1, -1, -1},
                    Figures{"OrientationTest/OrientationTest.glb", 524, 7, -1, -1, -1},
                    Figures{"NegativeScaleTest/NegativeScaleTest.glb", 7724, 6, 100, -1, 0},
                    Figures{"BoxInterleaved/BoxInterleaved.glb", 12, 1, -1, -1, -1},
                    Figures{"TwoSidedPlane/TwoSidedPlane.gltf", 2, 1, 0, 0, 0},
                    Figures{"Cube/Cube.gltf", 12, 1, 100, 50, 0},
                    Figures{"MeshPrimitiveModes/MeshPrimitiveModes.gltf", 16, 1, -1, -1, -1},
                    Figures{"TriangleWithoutIndices/TriangleWithoutIndices.gltf", 1, 1, -1, -1, -1},
                    Figures{"SimpleMeshes/SimpleMeshes.gltf", 2, 1, -1, -1, -1},
                    Figures{"Cameras/Cameras.gltf", 2, 1, -1, -1, -1},
                    Figures{"AnimatedMorphCube-Quantized/AnimatedMorphCube.gltf", 12, 1, -1, -1, -1}));

TEST(SharedAssets, meshes_without_uvs_are_told_how_to_get_them) {
  PATINA_REQUIRE_SHARED("assets/BoxInterleaved/BoxInterleaved.glb");
  const Asset asset = read_asset(test::shared_dir() / "assets/BoxInterleaved/BoxInterleaved.glb");
  try {
    require_enhanceable(asset);
    FAIL() << "was accepted";
  } catch (const Error& e) {
    EXPECT_NE(e.message().find("Smart UV Project"), std::string::npos);
  }
}

TEST(SharedAssets, triangles_wind_with_their_normals_also_under_negative_scale) {
  for (const char* name : {"NegativeScaleTest/NegativeScaleTest.glb", "WaterBottle/WaterBottle.gltf",
                           "SheenCloth/SheenCloth.gltf"}) {
    PATINA_REQUIRE_SHARED(std::filesystem::path("assets") / name);
    const Asset asset = read_asset(test::shared_dir() / "assets" / name);
    for (const Primitive& p : asset.primitives) {
      size_t agree = 0, differ = 0;
      for (const uvec3& t : p.triangles) {
        const vec3 geometric = glm::cross(p.p_world[t.y] - p.p_world[t.x], p.p_world[t.z] - p.p_world[t.x]);
        const float cosine = glm::dot(geometric, p.n_world[t.x] + p.n_world[t.y] + p.n_world[t.z]);
        agree += cosine > 0;
        differ += cosine < 0;
      }
      EXPECT_GT(agree, 50 * differ) << name << " " << p.name;
    }
  }
}

// The file's own tangents were made by a MikkTSpace implementation, so ours must point the same way.
TEST(SharedAssets, made_tangents_agree_with_those_of_the_authors) {
  struct Case {
    const char* path;
    float share;  // of vertices within 5 degrees and with the same sign
  };
  for (const Case& c : {Case{"WaterBottle/WaterBottle.gltf", 0.97f},
                        Case{"LightsPunctualLamp/LightsPunctualLamp.gltf", 0.95f},
                        Case{"AlphaBlendModeTest/AlphaBlendModeTest.gltf", 0.97f},
                        Case{"SheenCloth/SheenCloth.gltf", 0.99f}}) {
    PATINA_REQUIRE_SHARED(std::filesystem::path("assets") / c.path);
    const Asset asset = read_asset(test::shared_dir() / "assets" / c.path);
    size_t same = 0, all = 0;
    for (const Primitive& p : asset.primitives) {
      if (p.tangent_world.empty()) continue;
      Geometry g;
      g.position = p.p_world, g.normal = p.n_world, g.tangent = p.tangent_world, g.triangles = p.triangles;
      const Geometry made = with_mikktspace_tangents(g, p.uv[0]);
      // Vertices of the result keep their order of first use in triangles, which pairs them with the
      // originals.
      for (size_t t = 0; t < g.triangles.size(); ++t)
        for (int k = 0; k < 3; ++k) {
          const vec4 theirs = g.tangent[g.triangles[t][k]], ours = made.tangent[made.triangles[t][k]];
          ++all;
          same += theirs.w == ours.w && glm::dot(vec3(theirs), vec3(ours)) > std::cos(glm::radians(5.0f));
        }
    }
    EXPECT_GT(static_cast<float>(same), c.share * static_cast<float>(all))
        << c.path << ": " << same << " of " << all;
  }
}

}  // namespace
}  // namespace patina::asset
