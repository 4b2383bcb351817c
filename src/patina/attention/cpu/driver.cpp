// Packs keys and values once a head, cuts queries into blocks, and spreads (block, head) pairs over threads.
// Heads are taken in groups whose packed keys and values fit kGroupBytes, so that memory stays O(tokens ·
// head_dim) however many heads there are.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>

#include "patina/attention/bf16.h"
#include "patina/attention/cpu/kernel.h"
#include "patina/attention/cpu/query_blocks.h"
#include "patina/base/parallel.h"

namespace patina::attention {
namespace {

constexpr int64_t kGroupBytes = int64_t{64} << 20;

int64_t round_up(int64_t value, int64_t multiple) {
  return (value + multiple - 1) / multiple * multiple;
}

/// Uninitialised memory on cache lines.
struct AlignedDelete {
  void operator()(std::byte* p) const { ::operator delete[](p, std::align_val_t{64}); }
};
using AlignedBytes = std::unique_ptr<std::byte[], AlignedDelete>;
AlignedBytes aligned_bytes(int64_t size) {
  return AlignedBytes(static_cast<std::byte*>(
      ::operator new[](static_cast<size_t>(std::max<int64_t>(size, 64)), std::align_val_t{64})));
}

/// Sizes in bytes of one head's packed keys and values, rounded to cache lines, and of one block's queries.
struct PackedSizes {
  int64_t dim;   // head_dim as the packing pads it for scores
  int64_t keys;  // number of keys as the packing pads it
  int64_t k_bytes, v_bytes, q_bytes;
};
PackedSizes packed_sizes(Packing packing, int64_t num_keys, int64_t head_dim) {
  PackedSizes sizes{};
  int64_t element_bytes = 2, value_dim = head_dim;
  switch (packing) {
    case Packing::kF32:
      sizes.dim = head_dim;
      sizes.keys = num_keys;
      element_bytes = 4;
      break;
    case Packing::kBf16Pairs:
      sizes.dim = round_up(head_dim, 2);
      sizes.keys = round_up(num_keys, 16);
      break;
    case Packing::kBf16Tiles:
      sizes.dim = round_up(head_dim, 32);
      sizes.keys = round_up(num_keys, 32);
      value_dim = round_up(head_dim, 16);
      break;
  }
  sizes.k_bytes = round_up(sizes.keys * sizes.dim * element_bytes, 64);
  sizes.v_bytes = round_up(sizes.keys * value_dim * element_bytes, 64);
  sizes.q_bytes = round_up(sizes.dim * kBlockQueries * element_bytes, 64);
  return sizes;
}

void copy_row_f32(Element element, const void* source, int64_t offset, int64_t head_dim, float* to) {
  if (element == Element::kF32) {
    std::memcpy(to, static_cast<const float*>(source) + offset,
                static_cast<size_t>(head_dim) * sizeof(float));
  } else {
    const uint16_t* from = static_cast<const uint16_t*>(source) + offset;
    for (int64_t d = 0; d < head_dim; ++d) to[d] = float_of_bf16(from[d]);
  }
}

/// Keys [begin, end) of one head into its packed arrays; begin is a multiple of 32, and the range that ends
/// at num_keys writes the padding.
void pack_keys_values(const Arguments& a, Packing packing, const PackedSizes& sizes, int64_t k_base,
                      int64_t v_base, int64_t begin, int64_t end, void* k_out, void* v_out) {
  const int64_t dim = a.shape.head_dim;
  if (packing == Packing::kF32) {
    for (int64_t j = begin; j < end; ++j) {
      copy_row_f32(a.element, a.k, k_base + j * a.k_strides.token, dim, static_cast<float*>(k_out) + j * dim);
      copy_row_f32(a.element, a.v, v_base + j * a.v_strides.token, dim, static_cast<float*>(v_out) + j * dim);
    }
    return;
  }
  const uint16_t* k_in = static_cast<const uint16_t*>(a.k) + k_base;
  const uint16_t* v_in = static_cast<const uint16_t*>(a.v) + v_base;
  uint16_t* k = static_cast<uint16_t*>(k_out);
  uint16_t* v = static_cast<uint16_t*>(v_out);
  const int64_t padded_end = end == a.shape.num_keys ? sizes.keys : end;
  for (int64_t j = begin; j < padded_end; ++j) {
    const int64_t copied = j < end ? dim : 0;
    std::memcpy(k + j * sizes.dim, k_in + (j < end ? j * a.k_strides.token : 0),
                static_cast<size_t>(copied) * 2);
    std::fill(k + j * sizes.dim + copied, k + (j + 1) * sizes.dim, uint16_t{0});
  }
  const int64_t value_dim = round_up(dim, 16);
  for (int64_t j = begin; j < padded_end; ++j) {
    const uint16_t* row = j < end ? v_in + j * a.v_strides.token : nullptr;
    if (packing == Packing::kBf16Pairs) {
      uint16_t* pair = v + (j / 2 * dim) * 2 + j % 2;
      for (int64_t d = 0; d < dim; ++d) pair[2 * d] = row ? row[d] : uint16_t{0};
    } else {
      uint16_t* tile = v + j / 32 * value_dim * 32 + j % 32;
      for (int64_t d = 0; d < value_dim; ++d) tile[32 * d] = row && d < dim ? row[d] : uint16_t{0};
    }
  }
}

void pack_queries(const Arguments& a, Packing packing, const PackedSizes& sizes, int64_t q_base,
                  const QueryBlock& block, float scale, void* q_out) {
  const int64_t dim = a.shape.head_dim;
  std::memset(q_out, 0, static_cast<size_t>(sizes.q_bytes));
  for (int lane = 0; lane < block.num_lanes(); ++lane) {
    const int64_t offset = q_base + block.query(lane) * a.q_strides.token;
    if (packing == Packing::kF32) {
      float* q = static_cast<float*>(q_out) + lane;
      if (a.element == Element::kF32)
        for (int64_t d = 0; d < dim; ++d)
          q[d * kBlockQueries] = static_cast<const float*>(a.q)[offset + d] * scale;
      else
        for (int64_t d = 0; d < dim; ++d)
          q[d * kBlockQueries] = float_of_bf16(static_cast<const uint16_t*>(a.q)[offset + d]) * scale;
    } else {
      uint16_t* q = static_cast<uint16_t*>(q_out) + 2 * lane;
      for (int64_t d = 0; d < dim; ++d)
        q[d / 2 * 2 * kBlockQueries + d % 2] = static_cast<const uint16_t*>(a.q)[offset + d];
    }
  }
}

void write_rows(const Arguments& a, int64_t out_base, const QueryBlock& block, const float* rows) {
  for (int lane = 0; lane < block.num_lanes(); ++lane) {
    const int64_t offset = out_base + block.query(lane) * a.out_strides.token;
    for (int64_t d = 0; d < a.shape.head_dim; ++d) {
      const float value = rows[d * kBlockQueries + lane];
      if (a.element == Element::kF32)
        static_cast<float*>(a.out)[offset + d] = value;
      else
        static_cast<uint16_t*>(a.out)[offset + d] = bf16_of_float(value);
    }
  }
}

}  // namespace

void run_blocks(const Arguments& a, const Kernel& kernel) {
  const Shape& n = a.shape;
  const KeyBuckets* buckets = a.beta != 0 ? a.buckets : nullptr;
  const std::vector<QueryBlock> blocks = make_query_blocks(n.num_queries, buckets);
  const PackedSizes sizes = packed_sizes(kernel.packing, n.num_keys, n.head_dim);
  // Scores live in units of log 2, so that the softmax needs 2^x.
  const float scale = static_cast<float>(static_cast<double>(a.scale) * std::numbers::log2e);
  const float beta = static_cast<float>(static_cast<double>(a.beta) * std::numbers::log2e);
  const BiasedKey no_bias{std::numeric_limits<int32_t>::max(), 0};

  const int64_t num_heads = n.batch * n.num_heads;  // every (batch, head) pair
  const int64_t head_bytes = sizes.k_bytes + sizes.v_bytes;
  const int64_t group = std::clamp<int64_t>(kGroupBytes / head_bytes, 1, num_heads);
  const AlignedBytes packed = aligned_bytes(group * head_bytes);
  const auto base = [&](const Strides& s, int64_t head) {
    return head / n.num_heads * s.batch + head % n.num_heads * s.head;
  };

  for (int64_t head0 = 0; head0 < num_heads; head0 += group) {
    const int64_t heads = std::min(group, num_heads - head0);
    const auto keys_of = [&](int64_t head) { return packed.get() + (head - head0) * head_bytes; };

    constexpr int64_t kChunk = 1024;  // keys a task, a multiple of 32
    const int64_t chunks = (n.num_keys + kChunk - 1) / kChunk;
    parallel_for(0, heads * chunks, 1, [&](int64_t begin, int64_t end) {
      for (int64_t task = begin; task < end; ++task) {
        const int64_t head = head0 + task / chunks, key0 = task % chunks * kChunk;
        pack_keys_values(a, kernel.packing, sizes, base(a.k_strides, head), base(a.v_strides, head), key0,
                         std::min(key0 + kChunk, n.num_keys), keys_of(head), keys_of(head) + sizes.k_bytes);
      }
    });

    parallel_for(0, static_cast<int64_t>(blocks.size()) * heads, 1, [&](int64_t begin, int64_t end) {
      const AlignedBytes queries = aligned_bytes(sizes.q_bytes);
      const int64_t out_floats = round_up(n.head_dim, 16) * kBlockQueries;
      const AlignedBytes work = aligned_bytes((kScratchFloats + out_floats + kBlockQueries) * 4);
      Block block;
      block.q = queries.get();
      block.scratch = reinterpret_cast<float*>(work.get());
      block.out = block.scratch + kScratchFloats;
      block.log_sum_exp = block.out + out_floats;
      block.num_keys = n.num_keys;
      block.head_dim = static_cast<int>(n.head_dim);
      block.score_scale = kernel.packing == Packing::kF32 ? 1.0f : scale;
      block.beta = beta;

      std::vector<BiasedKey> biased;
      int64_t biased_block =
          -1;  // whose list `biased` is: the heads of a block follow each other and share it
      for (int64_t task = begin; task < end; ++task) {
        const int64_t index = task / heads, head = head0 + task % heads;
        const QueryBlock& queries_of = blocks[static_cast<size_t>(index)];
        if (buckets && biased_block != index) {
          biased = biased_keys_of_block(*buckets, queries_of);
          biased_block = index;
        }
        block.biased = buckets ? biased.data() : &no_bias;
        block.num_lanes = queries_of.num_lanes();
        block.k = keys_of(head);
        block.v = keys_of(head) + sizes.k_bytes;
        pack_queries(a, kernel.packing, sizes, base(a.q_strides, head), queries_of, scale, queries.get());
        kernel.attend(block);
        write_rows(a, base(a.out_strides, head), queries_of, block.out);
        if (a.log_sum_exp)
          for (int lane = 0; lane < block.num_lanes; ++lane)
            a.log_sum_exp[head * n.num_queries + queries_of.query(lane)] = block.log_sum_exp[lane];
      }
    });
  }
}

}  // namespace patina::attention
