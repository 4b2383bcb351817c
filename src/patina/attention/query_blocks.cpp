#include "patina/attention/query_blocks.h"

#include <algorithm>
#include <limits>

namespace patina::attention {
namespace {

constexpr int kBlockSide = 8;

/// Lanes of the block's pixels with x in [x0, x1) and y in [y0, y1), relative to its corner.
uint64_t lanes_of_rectangle(const QueryBlock& block, int x0, int x1, int y0, int y1) {
  const uint64_t run = ((uint64_t{1} << (x1 - x0)) - 1) << x0;  // at most 8 bits
  uint64_t lanes = 0;
  for (int y = y0; y < y1; ++y) lanes |= run << (y * block.row_length);
  return lanes;
}

}  // namespace

std::vector<QueryBlock> make_query_blocks(int64_t num_queries, const KeyBuckets* buckets) {
  std::vector<QueryBlock> blocks;
  if (!buckets) {
    for (int64_t first = 0; first < num_queries; first += kBlockQueries)
      blocks.push_back(
          {first, 1, static_cast<int>(std::min<int64_t>(kBlockQueries, num_queries - first)), 0});
    return blocks;
  }
  const int width = buckets->width();
  for (int view = 0; view < buckets->grid * buckets->grid; ++view) {
    const int view_x = view % buckets->grid * buckets->view_width,
              view_y = view / buckets->grid * buckets->view_height;
    for (int y = 0; y < buckets->view_height; y += kBlockSide)
      for (int x = 0; x < buckets->view_width; x += kBlockSide)
        blocks.push_back({static_cast<int64_t>(view_y + y) * width + view_x + x,
                          std::min(kBlockSide, buckets->view_height - y),
                          std::min(kBlockSide, buckets->view_width - x), width});
  }
  return blocks;
}

std::vector<BiasedKey> biased_keys_of_block(const KeyBuckets& buckets, const QueryBlock& block) {
  const int width = buckets.width(), radius = buckets.window_radius;
  const int x0 = static_cast<int>(block.first % width), y0 = static_cast<int>(block.first / width);
  const int view_x = x0 / buckets.view_width * buckets.view_width,
            view_y = y0 / buckets.view_height * buckets.view_height;
  // Cells of the block dilated by the window, clipped to the view.
  const int cell_x0 = std::max(x0 - radius, view_x);
  const int cell_x1 = std::min(x0 + block.row_length + radius, view_x + buckets.view_width);
  const int cell_y0 = std::max(y0 - radius, view_y);
  const int cell_y1 = std::min(y0 + block.num_rows + radius, view_y + buckets.view_height);

  std::vector<BiasedKey> list;
  for (int cell_y = cell_y0; cell_y < cell_y1; ++cell_y)
    for (int cell_x = cell_x0; cell_x < cell_x1; ++cell_x) {
      const size_t cell =
          static_cast<size_t>(cell_y) * static_cast<size_t>(width) + static_cast<size_t>(cell_x);
      if (buckets.offsets[cell] == buckets.offsets[cell + 1]) continue;
      // Queries whose window holds this cell.
      const uint64_t lanes = lanes_of_rectangle(
          block, std::max(cell_x - radius - x0, 0), std::min(cell_x + radius + 1 - x0, block.row_length),
          std::max(cell_y - radius - y0, 0), std::min(cell_y + radius + 1 - y0, block.num_rows));
      for (int32_t at = buckets.offsets[cell]; at < buckets.offsets[cell + 1]; ++at)
        list.push_back({buckets.keys[static_cast<size_t>(at)], lanes});
    }
  std::sort(list.begin(), list.end(), [](const BiasedKey& a, const BiasedKey& b) { return a.key < b.key; });

  // A key that lies in several cells is one key.
  size_t kept = 0;
  for (const BiasedKey& entry : list) {
    if (kept > 0 && list[kept - 1].key == entry.key)
      list[kept - 1].lanes |= entry.lanes;
    else
      list[kept++] = entry;
  }
  list.resize(kept);
  list.push_back({std::numeric_limits<int32_t>::max(), 0});
  return list;
}

}  // namespace patina::attention
