// Tiling views into a grid and cutting them apart.
#include <numeric>

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/views/view_set.h"

namespace patina::views {
namespace {

std::vector<Image> numbered_views(int count, int width, int height, int channels) {
  std::vector<Image> views;
  float value = 0;
  for (int i = 0; i < count; ++i) {
    Image& view = views.emplace_back(width, height, channels);
    for (float& pixel : view.pixels) pixel = value++;
  }
  return views;
}

TEST(Grid, untile_is_the_inverse_of_tile) {
  for (const int grid : {1, 2, 3, 4}) {
    const auto views = numbered_views(grid * grid, 5, 3, 2);
    const Image tiled = tile_grid(views);
    EXPECT_EQ(tiled.width, grid * 5);
    EXPECT_EQ(tiled.height, grid * 3);
    const auto again = untile_grid(tiled, grid);
    ASSERT_EQ(again.size(), views.size());
    for (size_t i = 0; i < views.size(); ++i) EXPECT_EQ(again[i].pixels, views[i].pixels);
  }
}

TEST(Grid, views_run_row_by_row) {
  const auto views = numbered_views(9, 4, 4, 1);
  const Image tiled = tile_grid(views);
  EXPECT_EQ(*tiled.at(4, 0), views[1].pixels[0]);
  EXPECT_EQ(*tiled.at(0, 4), views[3].pixels[0]);
  EXPECT_EQ(*tiled.at(11, 11), views[8].pixels[15]);
}

TEST(Grid, rejects_numbers_that_are_no_square_and_mixed_sizes) {
  EXPECT_THROW(tile_grid(numbered_views(5, 2, 2, 1)), Error);
  EXPECT_THROW(tile_grid({}), Error);
  auto views = numbered_views(4, 2, 2, 1);
  views[2] = Image(2, 3, 1);
  EXPECT_THROW(tile_grid(views), Error);
  EXPECT_THROW(untile_grid(Image(7, 6, 1), 3), Error);
  EXPECT_THROW(untile_grid(Image(6, 6, 1), 0), Error);
}

}  // namespace
}  // namespace patina::views
