// The example asset is what its maker makes, and is laid out as an artist would want it.
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "../support.h"
#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/base/files.h"

namespace patina {
namespace {

const std::filesystem::path kKettle = std::filesystem::path(PATINA_SOURCE_DIR) / "examples" / "kettle.glb";

TEST(Kettle, is_made_again_byte_by_byte) {
  const test::TemporaryFolder folder;
  const std::string command =
      std::string("'") + PATINA_MAKE_KETTLE + "' '" + (folder.path() / "kettle.glb").string() + "'";
  ASSERT_EQ(std::system(command.c_str()), 0);
  // Not EXPECT_EQ, which would print both files.
  EXPECT_TRUE(read_file(folder.path() / "kettle.glb") == read_file(kKettle))
      << "run make_kettle examples/kettle.glb if the change is meant";
}

TEST(Kettle, is_small_and_detailed_enough) {
  EXPECT_LE(std::filesystem::file_size(kKettle), 1500000u);
  const asset::Asset kettle = asset::read_asset(kKettle);
  EXPECT_EQ(kettle.materials.size(), 3u);
  EXPECT_EQ(kettle.images.size(), 9u);
  size_t triangles = 0;
  for (const asset::Primitive& primitive : kettle.primitives) triangles += primitive.triangles.size();
  EXPECT_GE(triangles, 8000u);
  EXPECT_LE(triangles, 20000u);
  EXPECT_TRUE(kettle.warnings.empty());
  const asset::Bounds box = asset::bounds(kettle);
  EXPECT_NEAR(box.min.y, 0, 0.003f) << "stands on the ground";
  EXPECT_NEAR(box.max.y - box.min.y, 0.25f, 0.02f);
}

TEST(Kettle, has_uvs_in_range_without_overlap_or_mirroring) {
  for (const asset::UvState& uv : asset::uv_states(asset::read_asset(kKettle))) {
    EXPECT_FALSE(uv.missing);
    EXPECT_GE(std::min(uv.min.x, uv.min.y), 0);
    EXPECT_LE(std::max(uv.max.x, uv.max.y), 1);
    EXPECT_LT(uv.overlapping, 0.001f);
    EXPECT_EQ(uv.mirrored, 0);
    EXPECT_EQ(uv.zero_area, 0);
    EXPECT_GT(uv.covered, 0.5f) << "the atlas is used";
  }
}

TEST(Kettle, normals_point_outward_and_texel_density_is_even) {
  for (const asset::Primitive& primitive : asset::read_asset(kKettle).primitives) {
    double area = 0, uv_area = 0, spread = 0;
    for (const uvec3& t : primitive.triangles) {
      const vec3 a = primitive.p_world[t.x], b = primitive.p_world[t.y], c = primitive.p_world[t.z];
      const vec3 cross = glm::cross(b - a, c - a);
      for (const uint32_t vertex : {t.x, t.y, t.z})
        EXPECT_GT(glm::dot(glm::normalize(cross), primitive.n_world[vertex]), 0.7f);
      const vec2 u = primitive.uv[0][t.y] - primitive.uv[0][t.x],
                 v = primitive.uv[0][t.z] - primitive.uv[0][t.x];
      area += 0.5 * glm::length(cross);
      uv_area += 0.5 * std::abs(u.x * v.y - u.y * v.x);
    }
    const double mean = std::sqrt(uv_area / area);  // texture lengths a metre
    for (const uvec3& t : primitive.triangles) {
      const vec3 a = primitive.p_world[t.x], b = primitive.p_world[t.y], c = primitive.p_world[t.z];
      const vec2 u = primitive.uv[0][t.y] - primitive.uv[0][t.x],
                 v = primitive.uv[0][t.z] - primitive.uv[0][t.x];
      const double here = 0.5 * glm::length(glm::cross(b - a, c - a));
      const double density = std::sqrt(0.5 * std::abs(u.x * v.y - u.y * v.x) / here);
      spread += here * std::abs(std::log2(density / mean));
    }
    EXPECT_LT(spread / area, 0.25) << "mean deviation in octaves";
  }
}

}  // namespace
}  // namespace patina
