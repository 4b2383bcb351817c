// Pictures side by side on one neutral sheet.
#include <algorithm>
#include <cmath>

#include "patina/base/check.h"
#include "patina/report/report.h"
#include "patina/report/scale.h"

namespace patina::report {
namespace {

constexpr float kGround = 0.5f;  // sRGB; neutral, so that it tints no judgement of colour
constexpr int kGapPixels = 8;    // between tiles and around them

}  // namespace

Image contact_sheet(std::span<const Image> images, int columns, int tile_width) {
  PATINA_CHECK(!images.empty() && columns > 0 && tile_width > 0);
  columns = std::min(columns, static_cast<int>(images.size()));

  // Tiles keep their shape; a row is as high as its highest tile.
  std::vector<Image> tiles;
  for (const Image& image : images) {
    PATINA_CHECK(!image.empty());
    const int height = std::max(
        1, static_cast<int>(std::lround(static_cast<double>(tile_width) * image.height / image.width)));
    tiles.push_back(scaled_srgb(as_rgb(image), tile_width, height));
  }
  std::vector<int> row_top{kGapPixels};
  for (size_t first = 0; first < tiles.size(); first += static_cast<size_t>(columns)) {
    int highest = 0;
    for (size_t i = first; i < std::min(tiles.size(), first + static_cast<size_t>(columns)); ++i)
      highest = std::max(highest, tiles[i].height);
    row_top.push_back(row_top.back() + highest + kGapPixels);
  }

  Image sheet(columns * (tile_width + kGapPixels) + kGapPixels, row_top.back(), 3, kGround);
  for (size_t i = 0; i < tiles.size(); ++i) {
    const int left =
        kGapPixels + static_cast<int>(i % static_cast<size_t>(columns)) * (tile_width + kGapPixels);
    const int top = row_top[i / static_cast<size_t>(columns)];
    for (int y = 0; y < tiles[i].height; ++y)
      std::copy_n(tiles[i].at(0, y), 3 * tile_width, sheet.at(left, top + y));
  }
  return sheet;
}

}  // namespace patina::report
