// The points of the surface field: how many, where, and that each belongs to one triangle.
#include <array>

#include <gtest/gtest.h>

#include "patina/correspond/surface_field.h"
#include "worlds.h"

namespace patina::correspond {
namespace {

using namespace test;

TEST(SurfaceField, points_are_dealt_out_by_area) {
  // Three squares of area 1, 4 and 16, of two triangles each.
  std::vector<scenes::Part> parts;
  for (const float side : {1.0f, 2.0f, 4.0f})
    parts.push_back({scenes::quad(vec3(0.0f), vec3(side, 0, 0), vec3(0, side, 0)), {}});
  const World world = make_world(parts);
  const SurfaceField field(*world.scene, 1000.0, 1 << 20);
  EXPECT_EQ(field.num_points(), 21000);
  ASSERT_EQ(field.num_triangles(), 6u);
  const std::array<double, 6> areas{0.5, 0.5, 2, 2, 8, 8};
  for (size_t i = 0; i < 6; ++i)
    EXPECT_NEAR(static_cast<double>(field.first_point(i + 1) - field.first_point(i)), 1000.0 * areas[i], 1.0);
}

TEST(SurfaceField, triangles_smaller_than_a_points_share_get_their_due_together) {
  const World world = sphere_world(UvState::kClean, 64);
  const SurfaceField field(*world.scene, 50.0, 1 << 20);  // about 600 points on 16,128 triangles
  EXPECT_NEAR(static_cast<double>(field.num_points()), 50.0 * 4.0 * static_cast<double>(kPi), 2.0);
}

TEST(SurfaceField, every_point_has_one_triangle) {
  const World world = sphere_world(UvState::kClean, 24);
  const SurfaceField field(*world.scene, 100.0, 1 << 20);
  for (int64_t point = 0; point < field.num_points(); ++point) {
    const size_t triangle = field.triangle_of_point(point);
    ASSERT_LE(field.first_point(triangle), point);
    ASSERT_LT(point, field.first_point(triangle + 1));
  }
}

TEST(SurfaceField, points_of_a_triangle_lie_inside_and_are_even) {
  // Sixteen equal parts of the triangle, by halving its sides twice, must hold a sixteenth each.
  constexpr int kCount = 4096;
  for (const size_t triangle : {size_t{0}, size_t{1}, size_t{12345}}) {
    std::array<int, 16> counts{};
    for (int n = 0; n < kCount; ++n) {
      const vec2 b = SurfaceField::points_of(triangle).at(n);
      ASSERT_GE(b.x, 0.0f);
      ASSERT_GE(b.y, 0.0f);
      ASSERT_LE(b.x + b.y, 1.0f);
      const int i = std::min(static_cast<int>(4.0f * b.x), 3), j = std::min(static_cast<int>(4.0f * b.y), 3);
      const bool upper = 4.0f * b.x - static_cast<float>(i) + 4.0f * b.y - static_cast<float>(j) > 1.0f;
      // Row j of the subdivision has 7 − 2j parts.
      const int row_start = j * (8 - j);
      ++counts[static_cast<size_t>(std::min(row_start + 2 * i + (upper ? 1 : 0), 15))];
    }
    // Random points would scatter by √(4096/16) = 16; these are more even.
    for (const int count : counts) EXPECT_NEAR(count, kCount / 16, 16);
  }
}

TEST(SurfaceField, number_of_points_is_capped) {
  const World world = sphere_world(UvState::kClean, 24);
  EXPECT_LE(SurfaceField(*world.scene, 1e12, 1000).num_points(), 1001);
  EXPECT_EQ(SurfaceField(*world.scene, 0.0, 1000).num_points(), 0);
}

}  // namespace
}  // namespace patina::correspond
