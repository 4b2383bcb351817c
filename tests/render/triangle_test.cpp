// Areas of a triangle in space and on a map, and its outward normal, against values known by hand.
#include "patina/render/triangle.h"

#include <gtest/gtest.h>

#include "scenes.h"

namespace patina::render {
namespace {

// 3 m by 2 m, facing +y; UVs cover the whole picture.
asset::Primitive table() {
  return test::quad({1, 5, 1}, {0, 0, 2}, {3, 0, 0});
}

TEST(triangle, area_and_normal_are_those_of_half_a_quad) {
  const asset::Primitive primitive = table();
  ASSERT_EQ(primitive.triangles.size(), 2u);
  for (uint32_t t = 0; t < 2; ++t) {
    const Triangle triangle = triangle_of(primitive, t);
    EXPECT_FLOAT_EQ(triangle.area(), 3.0f);
    EXPECT_EQ(triangle.cross(), vec3(0, 6, 0));
  }
}

TEST(triangle, barycentrics_lead_from_the_first_corner_to_the_others) {
  const Triangle triangle{{1, 0, 0}, {0, 2, 0}, {0, 0, 4}};
  EXPECT_EQ(triangle.at({0, 0}), triangle.a);
  EXPECT_EQ(triangle.at({1, 0}), triangle.b);
  EXPECT_EQ(triangle.at({0, 1}), triangle.c);
  EXPECT_EQ(triangle.at({0.25f, 0.25f}), vec3(0.5f, 0.5f, 1.0f));
}

TEST(triangle, uv_area_is_half_the_picture_and_never_negative) {
  asset::Primitive primitive = table();
  const asset::Map map;
  EXPECT_FLOAT_EQ(uv_area(primitive, 0, map), 0.5f);
  for (vec2& uv : primitive.uv[0]) uv.x = -uv.x;  // mirrored
  EXPECT_FLOAT_EQ(uv_area(primitive, 0, map), 0.5f);
}

TEST(triangle, uv_area_follows_the_set_and_the_transform_of_the_map) {
  asset::Primitive primitive = table();
  primitive.uv.push_back(primitive.uv[0]);
  for (vec2& uv : primitive.uv[1]) uv *= 0.5f;
  asset::Map map;
  map.uv_set = 1;
  EXPECT_FLOAT_EQ(uv_area(primitive, 1, map), 0.125f);
  map.uv_transform = mat3(4, 0, 0, 0, 3, 0, 0.5f, 0, 1);  // repeats on the triangle
  EXPECT_FLOAT_EQ(uv_area(primitive, 1, map), 1.5f);
}

TEST(triangle, one_without_area_has_no_normal) {
  const Triangle needle{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  EXPECT_EQ(needle.area(), 0.0f);
  EXPECT_EQ(needle.cross(), vec3(0.0f));
}

}  // namespace
}  // namespace patina::render
