// Tiling views into a grid.
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

TEST(Grid, every_view_lies_whole_in_its_tile) {
  for (const int grid : {1, 2, 3, 4}) {
    const auto views = numbered_views(grid * grid, 5, 3, 2);
    const Image tiled = tile_grid(views);
    ASSERT_EQ(tiled.width, grid * 5);
    ASSERT_EQ(tiled.height, grid * 3);
    for (int y = 0; y < tiled.height; ++y)
      for (int x = 0; x < tiled.width; ++x)
        for (int c = 0; c < 2; ++c)
          ASSERT_EQ(tiled.at(x, y)[c], views[static_cast<size_t>(y / 3 * grid + x / 5)].at(x % 5, y % 3)[c]);
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
}

}  // namespace
}  // namespace patina::views
