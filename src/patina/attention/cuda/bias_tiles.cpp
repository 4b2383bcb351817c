#include "patina/attention/cuda/bias_tiles.h"

#include <algorithm>
#include <bit>
#include <tuple>

#include "patina/attention/query_blocks.h"
#include "patina/base/check.h"

namespace patina::attention::cuda {

static_assert(kBlockLanes == kBlockQueries);

BiasTiles make_bias_tiles(const KeyBuckets& buckets) {
  validate(buckets);
  BiasTiles tiles;
  tiles.num_queries = static_cast<int32_t>(buckets.num_pixels());
  tiles.row_stride = buckets.width();
  for (const QueryBlock& block : make_query_blocks(buckets.num_pixels(), &buckets)) {
    std::vector<BiasedKey> list = biased_keys_of_block(buckets, block);
    list.pop_back();  // the end mark
    if (list.empty()) continue;
    const auto order = [](const BiasedKey& biased) {
      const int first_warp = std::countr_zero(biased.lanes) / kWarpLanes;
      const int last_warp = (63 - std::countl_zero(biased.lanes)) / kWarpLanes;
      return std::tuple(first_warp, last_warp, biased.key);
    };
    std::sort(list.begin(), list.end(),
              [&](const BiasedKey& a, const BiasedKey& b) { return order(a) < order(b); });

    const size_t first_tile = tiles.keys.size() / kTileKeys;
    const size_t num_tiles = (list.size() + kTileKeys - 1) / kTileKeys;
    PATINA_CHECK_LT(first_tile + num_tiles, size_t{1} << 31);
    tiles.blocks.push_back({static_cast<int32_t>(block.first), static_cast<int32_t>(first_tile),
                            static_cast<int32_t>(num_tiles), static_cast<int16_t>(block.num_lanes()),
                            static_cast<int16_t>(block.row_length),
                            (511 + block.row_length) / block.row_length});
    // Padding repeats the last key: its row is read, and its weight is 0 for every lane.
    tiles.keys.resize((first_tile + num_tiles) * kTileKeys, list.back().key);
    tiles.masks.resize((first_tile + num_tiles) * kBlockLanes, 0);
    for (size_t at = 0; at < list.size(); ++at) {
      tiles.keys[first_tile * kTileKeys + at] = list[at].key;
      uint32_t* masks = tiles.masks.data() + (first_tile + at / kTileKeys) * kBlockLanes;
      for (uint64_t lanes = list[at].lanes; lanes != 0; lanes &= lanes - 1)
        masks[std::countr_zero(lanes)] |= uint32_t{1} << at % kTileKeys;
    }
  }
  std::stable_sort(tiles.blocks.begin(), tiles.blocks.end(),
                   [](const TiledBlock& a, const TiledBlock& b) { return a.num_tiles > b.num_tiles; });
  return tiles;
}

}  // namespace patina::attention::cuda
