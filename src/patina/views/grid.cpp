// Views tiled row by row into one square image.
#include <algorithm>
#include <string>

#include "patina/base/error.h"
#include "patina/views/view_set.h"

namespace patina::views {

int grid_of(size_t num_views) {
  int grid = 0;
  while (static_cast<size_t>(grid) * static_cast<size_t>(grid) < num_views) ++grid;
  if (num_views == 0 || static_cast<size_t>(grid) * static_cast<size_t>(grid) != num_views) {
    throw Error(ErrorCode::kUsage, "view grid",
                "the number of views must be a square (4, 9 or 16), found " + std::to_string(num_views));
  }
  return grid;
}

Image tile_grid(std::span<const Image> views) {
  const int grid = grid_of(views.size());
  const Image& first = views.front();
  Image out(grid * first.width, grid * first.height, first.channels);
  for (size_t index = 0; index < views.size(); ++index) {
    const Image& view = views[index];
    if (view.width != first.width || view.height != first.height || view.channels != first.channels) {
      throw Error(ErrorCode::kUsage, "view " + std::to_string(index),
                  "all views of a grid must have one size: expected " + std::to_string(first.width) + " x " +
                      std::to_string(first.height) + " x " + std::to_string(first.channels) + ", found " +
                      std::to_string(view.width) + " x " + std::to_string(view.height) + " x " +
                      std::to_string(view.channels));
    }
    const int x0 = static_cast<int>(index) % grid * view.width;
    const int y0 = static_cast<int>(index) / grid * view.height;
    for (int y = 0; y < view.height; ++y)
      std::copy_n(view.at(0, y), static_cast<size_t>(view.width) * static_cast<size_t>(view.channels),
                  out.at(x0, y0 + y));
  }
  return out;
}

}  // namespace patina::views
