// Vertex colours as a strength map: a quad whose colours are known at every point.
#include "patina/masks/vertex_color.h"

#include <gtest/gtest.h>

#include "patina/asset/asset.h"

namespace patina::masks {
namespace {

// A unit square on the left half of the texture, black at its left edge and white at its right one.
asset::Primitive ramp() {
  asset::Primitive p;
  p.p_world = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  p.uv = {{{0, 1}, {0.5f, 1}, {0.5f, 0}, {0, 0}}};
  p.color = {vec4(0, 0, 0, 1), vec4(1), vec4(1), vec4(0, 0, 0, 1)};
  p.triangles = {{0, 1, 2}, {0, 2, 3}};
  return p;
}

TEST(VertexColor, is_interpolated_over_the_surface) {
  const asset::Primitive quad = ramp();
  const std::vector<const asset::Primitive*> primitives{&quad};
  const auto map = vertex_color_strength(primitives, asset::Map{}, 64, 64, 0);
  ASSERT_TRUE(map);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 31; ++x)
      EXPECT_NEAR(*map->texels.at(x, y), (static_cast<float>(x) + 0.5f) / 32, 0.02f) << x << ' ' << y;
  EXPECT_NEAR(*map->texels.at(36, 20), 1.0f, 0.04f) << "goes on beyond the surface";
  EXPECT_EQ(*map->texels.at(50, 20), 0.0f);
}

TEST(VertexColor, parts_without_colours_count_as_white_and_materials_without_any_have_no_map) {
  asset::Primitive quad = ramp(), plain = ramp();
  plain.color.clear();
  for (vec2& uv : plain.uv[0]) uv.x += 0.5f;
  const std::vector<const asset::Primitive*> primitives{&quad, &plain};
  const auto map = vertex_color_strength(primitives, asset::Map{}, 64, 64, 0);
  ASSERT_TRUE(map);
  EXPECT_EQ(*map->texels.at(48, 20), 1.0f);
  EXPECT_FALSE(vertex_color_strength(std::vector<const asset::Primitive*>{&plain}, asset::Map{}, 64, 64, 0));
  EXPECT_FALSE(vertex_color_strength(primitives, asset::Map{}, 64, 64, 1));
}

}  // namespace
}  // namespace patina::masks
