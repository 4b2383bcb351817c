// Strength maps: zero is exact at every size and on other UVs; between, values are means and interpolations.
#include "patina/asset/strength_map.h"

#include <gtest/gtest.h>

#include "patina/asset/asset.h"
#include "patina/asset/texel_raster.h"
#include "patina/base/random.h"

namespace patina::asset {
namespace {

Map map_of(Image texels) {
  Map map;
  map.texels = std::move(texels);
  return map;
}

Map speckled(int width, int height) {
  Image texels(width, height, 1);
  RandomStream random(1, RandomPurpose::kTest, 9);
  for (float& v : texels.pixels) v = random.uniform() < 0.6f ? 0.0f : random.uniform();
  return map_of(std::move(texels));
}

TEST(StrengthMap, reads_zero_wherever_the_nearest_texel_is_zero) {
  const Map map = speckled(7, 5);
  RandomStream random(2, RandomPurpose::kTest, 1);
  int zeros = 0;
  for (int k = 0; k < 2000; ++k) {
    const vec2 uv = random.uniform2();
    const float nearest = *map.texels.at(static_cast<int>(uv.x * 7), static_cast<int>(uv.y * 5));
    const float found = strength_at(map, uv);
    if (nearest == 0.0f) {
      EXPECT_EQ(found, 0.0f);
      ++zeros;
    } else {
      EXPECT_EQ(found, read1(map, bilinear_tap(map, uv)));
    }
  }
  EXPECT_GT(zeros, 500);
}

// By brute force over the real intervals that texels cover.
TEST(StrengthMap, resized_texels_are_zero_exactly_where_all_that_they_overlap_are) {
  const Map map = speckled(13, 9);
  for (const ivec2 size :
       {ivec2(13, 9), ivec2(26, 27), ivec2(5, 4), ivec2(31, 3), ivec2(1, 1), ivec2(16, 16)}) {
    const Map out = resized_strength(map, size.x, size.y);
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x) {
        bool any = false;
        for (int v = 0; v < 9; ++v)
          for (int u = 0; u < 13; ++u)
            any |= *map.texels.at(u, v) > 0 && u * size.x < (x + 1) * 13 && (u + 1) * size.x > x * 13 &&
                   v * size.y < (y + 1) * 9 && (v + 1) * size.y > y * 9;
        if (!any) {
          EXPECT_EQ(*out.texels.at(x, y), 0.0f) << size.x << ' ' << size.y << ": " << x << ' ' << y;
        }
        if (any && size.x <= 13 && size.y <= 9) {
          EXPECT_GT(*out.texels.at(x, y), 0.0f) << x << ' ' << y;
        }
      }
  }
}

TEST(StrengthMap, shrinking_keeps_the_mean) {
  const Map map = speckled(16, 16);
  const auto mean = [](const Image& image) {
    double sum = 0;
    for (const float v : image.pixels) sum += v;
    return sum / static_cast<double>(image.pixels.size());
  };
  EXPECT_NEAR(mean(resized_strength(map, 4, 8).texels), mean(map.texels), 1e-6);
}

// A square whose second UV set is its first turned by a quarter: the strength follows the surface.
TEST(StrengthMap, on_other_uvs_a_texel_has_the_strength_of_its_place_on_the_surface) {
  Primitive quad;
  quad.p_world = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  quad.uv = {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0, 1}, {0, 0}, {1, 0}, {1, 1}}};
  quad.triangles = {{0, 1, 2}, {0, 2, 3}};
  const std::vector<const Primitive*> primitives{&quad};
  const Map strength = speckled(8, 8);
  Map like;
  like.uv_set = 1;
  const Image turned = strength_of_texels(primitives, strength, like, 8, 8, 0);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 8; ++x) EXPECT_NEAR(*turned.at(y, 7 - x), *strength.texels.at(x, y), 1e-4f);
  EXPECT_EQ(strength_of_texels(primitives, strength, like, 8, 8, 1).pixels, Image(8, 8, 1, 1.0f).pixels);
}

TEST(TexelRaster, every_texel_inside_a_triangle_is_touched_once_and_interpolates_its_point) {
  Primitive triangle;
  triangle.p_world = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}};
  triangle.uv = {{{0, 0}, {1, 0}, {0, 1}}};
  triangle.triangles = {{0, 1, 2}};
  Map map;
  map.wrap_s = map.wrap_t = Wrap::kClampToEdge;
  map.texels = Image(16, 16, 1);
  std::vector<int> count(256);
  each_touched_texel(std::vector<const Primitive*>{&triangle}, map, 0, [&](const TouchedTexel& touched) {
    if (!touched.inside) return;  // beside the triangle, or beyond the texture's border
    ++count[touched.texel];
    const int x = static_cast<int>(touched.texel) % 16, y = static_cast<int>(touched.texel) / 16;
    const vec3 p = touched.interpolated(triangle.p_world);
    EXPECT_NEAR(p.x, (static_cast<float>(x) + 0.5f) / 8, 1e-5f);
    EXPECT_NEAR(p.y, (static_cast<float>(y) + 0.5f) / 8, 1e-5f);
  });
  for (int y = 0; y < 15; ++y)
    for (int x = 0; x < 15 - y; ++x) EXPECT_EQ(count[static_cast<size_t>(16 * y + x)], 1);
  EXPECT_EQ(count[255], 0);
}

}  // namespace
}  // namespace patina::asset
