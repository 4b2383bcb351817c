// Cuts queries into blocks of 64 lanes and lists each block's biased keys: what the CPU and CUDA kernels
// share. Private to attention.
#pragma once

#include <cstdint>
#include <vector>

#include "patina/attention/attention.h"

namespace patina::attention {

inline constexpr int kBlockQueries = 64;  // lanes of a block: 8 × 8 latent pixels where a bias is given

/// A key and the lanes of the block for which it is biased.
struct BiasedKey {
  int32_t key;
  uint64_t lanes;
};

/// The queries of one block: `num_rows` runs of `row_length` consecutive queries, `row_stride` apart.
/// Lane l holds query first + (l / row_length) · row_stride + l % row_length.
struct QueryBlock {
  int64_t first = 0;
  int num_rows = 1, row_length = 0;
  int64_t row_stride = 0;

  int num_lanes() const { return num_rows * row_length; }
  int64_t query(int lane) const { return first + lane / row_length * row_stride + lane % row_length; }
};

/// Without buckets: runs of 64 queries. With: rectangles of at most 8 × 8 latent pixels that lie inside one
/// view, so that a block's queries share almost all their biased keys.
std::vector<QueryBlock> make_query_blocks(int64_t num_queries, const KeyBuckets* buckets);

/// The union of S_i over the block, keys ascending, each with the lanes it is biased for; the entry with key
/// INT32_MAX ends the list.
std::vector<BiasedKey> biased_keys_of_block(const KeyBuckets& buckets, const QueryBlock& block);

}  // namespace patina::attention
