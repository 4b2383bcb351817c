// Heat maps and marks: each pixel shows its own cell, outlines lie on the border of the union.
#include "patina/report/heat_map.h"

#include <gtest/gtest.h>

#include "pictures.h"

namespace patina::report {
namespace {

constexpr vec3 kRed{1, 0, 0};
constexpr vec3 kLuminance{0.2126f, 0.7152f, 0.0722f};

TEST(HeatMap, colours_get_lighter_from_nothing_to_all) {
  float last = -1;
  for (int i = 0; i <= 100; ++i) {
    const float luminance = glm::dot(heat_color(static_cast<float>(i) / 100), kLuminance);
    EXPECT_GT(luminance, last) << i;
    last = luminance;
  }
  EXPECT_EQ(heat_color(-1), heat_color(0));
  EXPECT_EQ(heat_color(7), heat_color(1));
}

TEST(HeatMap, a_pixel_shows_the_cell_that_holds_its_centre) {
  // 7 × 5 pixels over 3 × 2 cells: pixel centres (x + ½)/7·3.
  const Image picture(7, 5, 3, 0.5f);
  const std::vector<float> values{0, 1, 2, 3, 4, 5};
  const Image map = heat_overlay(picture, {3, 2}, values, 5);
  const int columns[] = {0, 0, 1, 1, 1, 2, 2}, rows[] = {0, 0, 1, 1, 1};
  for (int y = 0; y < 5; ++y)
    for (int x = 0; x < 7; ++x) {
      const float share = std::sqrt(values[static_cast<size_t>(3 * rows[y] + columns[x])] / 5);
      const vec3 expected = glm::mix(vec3(0.275f), heat_color(share), 0.15f + 0.85f * share);
      EXPECT_LT(glm::distance(map.rgb(x, y), expected), 1e-5f) << x << " " << y;
    }
}

TEST(HeatMap, more_than_the_brightest_is_the_last_colour_and_nothing_is_no_number) {
  const Image picture(2, 1, 3, 0.5f);
  const Image map = heat_overlay(picture, {2, 1}, std::vector<float>{3, 9}, 1);
  EXPECT_LT(glm::distance(map.rgb(0, 0), heat_color(1)), 1e-5f);
  EXPECT_EQ(map.rgb(0, 0), map.rgb(1, 0));
  for (const float value : heat_overlay(picture, {2, 1}, std::vector<float>{0, 0}, 0).pixels)
    EXPECT_TRUE(std::isfinite(value));
}

TEST(HeatMap, an_outline_runs_around_the_union_of_cells_and_nowhere_else) {
  const Image picture(40, 40, 3, 0.5f);
  const Image marked =
      with_outline(picture, {4, 4}, std::vector<int32_t>{5, 6}, kRed, 2);  // cells (1,1) and (2,1)
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x) {
      const bool inside = x >= 10 && x < 30 && y >= 10 && y < 20;
      const bool middle = x >= 12 && x < 28 && y >= 12 && y < 18;
      EXPECT_EQ(marked.rgb(x, y), inside && !middle ? kRed : vec3(0.5f)) << x << " " << y;
    }
  EXPECT_EQ(with_outline(picture, {4, 4}, {}, kRed, 2).pixels, picture.pixels);
}

TEST(HeatMap, a_frame_is_cut_at_the_border_of_the_picture) {
  const Image picture(10, 10, 3, 0.5f);
  const Image framed = with_frame(picture, -2, 3, 6, 4, kRed, 1);
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 10; ++x) {
      const bool on_frame = x <= 3 && y >= 3 && y <= 6 && (x == 3 || y == 3 || y == 6);
      EXPECT_EQ(framed.rgb(x, y), on_frame ? kRed : vec3(0.5f)) << x << " " << y;
    }
}

}  // namespace
}  // namespace patina::report
