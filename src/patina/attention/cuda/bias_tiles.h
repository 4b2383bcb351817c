// The biased keys of every query block, cut into tiles of 32 keys, as the CUDA kernel reads them: flat arrays
// that are made once a resolution on the CPU and copied to the device. No CUDA here.
#pragma once

#include <cstdint>
#include <vector>

#include "patina/attention/attention.h"

namespace patina::attention::cuda {

inline constexpr int kTileKeys = 32;    // a lane's mask of a tile is one 32-bit word
inline constexpr int kBlockLanes = 64;  // queries of a block
inline constexpr int kWarpLanes = 16;   // queries that one warp takes: the rows of a matrix instruction

/// One block of 8 × 8 queries (less at a view's edge) that has biased keys.
struct TiledBlock {
  int32_t first_query = 0;
  int32_t first_tile = 0, num_tiles = 0;
  int16_t num_lanes = 0, row_length = 0;
  int32_t reciprocal = 0;  // ⌈512 / row_length⌉: a lane's row is lane · reciprocal / 512, exact up to lane 63

  constexpr int32_t query(int lane, int32_t row_stride) const {
    const int row = lane * reciprocal >> 9;
    return first_query + row * row_stride + lane - row * row_length;
  }
};

/// At r = 4 a key is listed in about four blocks of every view it lands in: O(N) memory.
struct BiasTiles {
  int32_t num_queries = 0, row_stride = 0;  // pixels of the grid, and of one of its rows
  std::vector<TiledBlock> blocks;           // only those with biased keys; longest list first, so that a long
                                            // one does not end alone
  std::vector<int32_t> keys;                // [tiles][32]; a last tile is filled up with keys of no lane
  std::vector<uint32_t> masks;              // [tiles][64]: bit j of lane l is whether l's query is biased
                                            // toward the tile's key j

  int64_t num_tiles() const { return static_cast<int64_t>(keys.size()) / kTileKeys; }
};

/// Within a block, keys that the same warps need follow each other, so that a warp can skip most tiles
/// that hold nothing for it.
BiasTiles make_bias_tiles(const KeyBuckets& buckets);

}  // namespace patina::attention::cuda
