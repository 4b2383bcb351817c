// Packs keys and values once a head, cuts queries into blocks, and spreads (run of blocks, head) pairs over
// threads. Heads are taken in groups whose packed keys and values fit kGroupBytes, so that memory stays
// O(tokens · head_dim) however many heads there are. A kernel that takes panels sees the keys a panel at a
// time, each for a whole run of blocks: a panel and the run's state stay in the second cache.
#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>

#include "patina/base/bf16.h"
#include "patina/attention/cpu/kernel.h"
#include "patina/attention/cpu/transpose.h"
#include "patina/attention/query_blocks.h"
#include "patina/base/parallel.h"

namespace patina::attention {
namespace {

constexpr int64_t kGroupBytes = int64_t{64} << 20;
constexpr int64_t kPanelBytes = int64_t{512} << 10;  // packed keys and values of a panel
constexpr int64_t kRunBytes = int64_t{768} << 10;    // packed queries and state of a run of blocks
constexpr int64_t kPanelKeys = 128;                  // a panel is a multiple of this

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
      sizes.keys = round_up(num_keys, kPanelKeys);
      value_dim = head_dim / 16 * 16 + 16;
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

/// Whether all are numbers below 2^kModerate in magnitude.
bool all_moderate(const uint16_t* bf16, int64_t count) {
  constexpr uint16_t kLimit = (127 + kModerate) << 7;
  bool moderate = true;
  for (int64_t i = 0; i < count; ++i) moderate &= (bf16[i] & 0x7fff) < kLimit;
  return moderate;
}

/// Keys [begin, end) of one head into its packed arrays; begin is a multiple of 128, and the range that ends
/// at num_keys writes the padding. Returns whether all are moderate (kBf16Tiles; else true).
bool pack_keys_values(const Arguments& a, Packing packing, const PackedSizes& sizes, int64_t k_base,
                      int64_t v_base, int64_t begin, int64_t end, void* k_out, void* v_out) {
  const int64_t dim = a.shape.head_dim;
  if (packing == Packing::kF32) {
    for (int64_t j = begin; j < end; ++j) {
      copy_row_f32(a.element, a.k, k_base + j * a.k_strides.token, dim, static_cast<float*>(k_out) + j * dim);
      copy_row_f32(a.element, a.v, v_base + j * a.v_strides.token, dim, static_cast<float*>(v_out) + j * dim);
    }
    return true;
  }
  const uint16_t* k_in = static_cast<const uint16_t*>(a.k) + k_base;
  const uint16_t* v_in = static_cast<const uint16_t*>(a.v) + v_base;
  uint16_t* k = static_cast<uint16_t*>(k_out);
  uint16_t* v = static_cast<uint16_t*>(v_out);
  const bool tiles = packing == Packing::kBf16Tiles;
  const int64_t value_dim = tiles ? dim / 16 * 16 + 16 : dim;
  const int64_t padded_end = end == a.shape.num_keys ? sizes.keys : end;
  bool moderate = true;
  for (int64_t j = begin; j < padded_end; ++j) {
    const int64_t copied = j < end ? dim : 0;
    const uint16_t* row = k_in + (j < end ? j * a.k_strides.token : 0);
    uint16_t* to = tiles ? k + j / 16 * 16 * sizes.dim + j % 16 * 32 : k + j * sizes.dim;
    const int64_t run = tiles ? 32 : sizes.dim, run_stride = tiles ? 512 : 0;
    for (int64_t d = 0; d < sizes.dim; d += run, to += run_stride) {
      const int64_t count = std::clamp<int64_t>(copied - d, 0, run);
      std::memcpy(to, row + (count > 0 ? d : 0), static_cast<size_t>(count) * 2);
      std::memset(to + count, 0, static_cast<size_t>(run - count) * 2);
    }
    if (tiles && copied > 0)
      moderate = moderate && all_moderate(row, dim) && all_moderate(v_in + j * a.v_strides.token, dim);
  }
  if (tiles) {
    for (int64_t j0 = begin; j0 < padded_end; j0 += 32) {
      uint16_t* to = v + j0 * value_dim;  // [value_dim][32 keys]
      const int64_t count = std::clamp<int64_t>(end - j0, 0, 32);
      if (count < 32) std::memset(to, 0, static_cast<size_t>(value_dim) * 64);
      const uint16_t* rows = v_in + j0 * a.v_strides.token;
      transpose(rows, a.v_strides.token, count, dim, to, 32);
      std::fill(to + dim * 32, to + dim * 32 + count, bf16_of_float(1.0f));
      std::memset(to + (dim + 1) * 32, 0, static_cast<size_t>(value_dim - dim - 1) * 64);
    }
  } else {
    for (int64_t j = begin; j < padded_end; ++j) {
      const uint16_t* row = j < end ? v_in + j * a.v_strides.token : nullptr;
      uint16_t* pair = v + (j / 2 * dim) * 2 + j % 2;
      for (int64_t d = 0; d < dim; ++d) pair[2 * d] = row ? row[d] : uint16_t{0};
    }
  }
  return moderate;
}

/// pairs: room for kBlockQueries rows of head_dim, bf16. Returns the lanes that are not moderate
/// (kBf16Tiles).
uint64_t pack_queries(const Arguments& a, Packing packing, const PackedSizes& sizes, int64_t q_base,
                      const QueryBlock& block, float scale, uint32_t* pairs, void* q_out) {
  const int64_t dim = a.shape.head_dim, num_pairs = (dim + 1) / 2;
  std::memset(q_out, 0, static_cast<size_t>(sizes.q_bytes));
  uint64_t immoderate = 0;
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
      continue;
    }
    const uint16_t* row = static_cast<const uint16_t*>(a.q) + offset;
    pairs[(lane + 1) * num_pairs - 1] = 0;
    std::memcpy(pairs + lane * num_pairs, row, static_cast<size_t>(dim) * 2);
    if (packing == Packing::kBf16Tiles && !all_moderate(row, dim)) immoderate |= uint64_t{1} << lane;
  }
  if (packing == Packing::kF32) return 0;
  const int64_t num_lanes = block.num_lanes();
  // Pairs of dimensions are 32-bit elements: [lanes][pairs] -> [pairs][lanes], in one piece or 16 lanes a
  // tile.
  const int64_t lanes_a_piece = packing == Packing::kBf16Tiles ? 16 : kBlockQueries;
  for (int64_t lane = 0; lane < num_lanes; lane += lanes_a_piece)
    transpose(pairs + lane * num_pairs, num_pairs, std::min(lanes_a_piece, num_lanes - lane), num_pairs,
              static_cast<uint32_t*>(q_out) + lane * sizes.dim / 2, lanes_a_piece);
  return immoderate;
}

/// rows: [head_dim][64] f32; bf16: room for as many, where the element is that.
void write_rows(const Arguments& a, int64_t out_base, const QueryBlock& block, const float* rows,
                uint16_t* bf16) {
  const int64_t dim = a.shape.head_dim;
  if (a.element == Element::kBf16) {
    for (int64_t i = 0; i < dim * kBlockQueries; ++i) bf16[i] = bf16_of_float(rows[i]);
    // Lanes of one run of queries are as far apart as tokens.
    for (int lane = 0; lane < block.num_lanes(); lane += block.row_length)
      transpose(bf16 + lane, kBlockQueries, dim, block.row_length,
                static_cast<uint16_t*>(a.out) + out_base + block.query(lane) * a.out_strides.token,
                a.out_strides.token);
    return;
  }
  for (int lane = 0; lane < block.num_lanes(); ++lane) {
    float* out = static_cast<float*>(a.out) + out_base + block.query(lane) * a.out_strides.token;
    for (int64_t d = 0; d < dim; ++d) out[d] = rows[d * kBlockQueries + lane];
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
  std::vector<std::atomic<bool>> moderate(static_cast<size_t>(group));  // one a head of the group
  const auto base = [&](const Strides& s, int64_t head) {
    return head / n.num_heads * s.batch + head % n.num_heads * s.head;
  };

  const int head_dim = static_cast<int>(n.head_dim);
  const int64_t state_bytes = kernel.state_floats ? kernel.state_floats(head_dim) * 4 : 0;
  const int64_t panel_keys =
      kernel.takes_panels
          ? std::max(kPanelKeys, kPanelBytes * sizes.keys / head_bytes / kPanelKeys * kPanelKeys)
          : n.num_keys;
  // As long a run as fits, if that leaves a few tasks to each thread; of one block where there is one panel.
  const int64_t num_blocks = static_cast<int64_t>(blocks.size());
  const int64_t run =
      panel_keys >= n.num_keys
          ? 1
          : std::clamp<int64_t>(std::min(kRunBytes / (state_bytes + sizes.q_bytes),
                                         num_blocks * num_heads / (int64_t{4} * num_threads())),
                                1, num_blocks);
  const int64_t num_runs = (num_blocks + run - 1) / run;

  for (int64_t head0 = 0; head0 < num_heads; head0 += group) {
    const int64_t heads = std::min(group, num_heads - head0);
    const auto keys_of = [&](int64_t head) { return packed.get() + (head - head0) * head_bytes; };
    for (std::atomic<bool>& m : moderate) m = true;

    constexpr int64_t kChunk = 1024;  // keys a task, a multiple of kPanelKeys
    const int64_t chunks = (n.num_keys + kChunk - 1) / kChunk;
    parallel_for(0, heads * chunks, 1, [&](int64_t begin, int64_t end) {
      for (int64_t task = begin; task < end; ++task) {
        const int64_t head = head0 + task / chunks, key0 = task % chunks * kChunk;
        if (!pack_keys_values(a, kernel.packing, sizes, base(a.k_strides, head), base(a.v_strides, head),
                              key0, std::min(key0 + kChunk, n.num_keys), keys_of(head),
                              keys_of(head) + sizes.k_bytes))
          moderate[static_cast<size_t>(head - head0)] = false;
      }
    });

    parallel_for(0, num_runs * heads, 1, [&](int64_t begin, int64_t end) {
      const AlignedBytes queries = aligned_bytes(run * sizes.q_bytes),
                         states = aligned_bytes(run * state_bytes);
      const int64_t out_floats = round_up(n.head_dim, 16) * kBlockQueries;
      const AlignedBytes work = aligned_bytes((kScratchFloats + out_floats + kBlockQueries) * 4);
      Block block;
      block.scratch = reinterpret_cast<float*>(work.get());
      block.out = block.scratch + kScratchFloats;
      block.log_sum_exp = block.out + out_floats;
      block.num_keys = n.num_keys;
      block.head_dim = head_dim;
      block.score_scale = kernel.packing == Packing::kF32 ? 1.0f : scale;
      block.beta = beta;

      std::vector<uint16_t> rounded(static_cast<size_t>(out_floats));
      std::vector<uint32_t> pairs(static_cast<size_t>(out_floats / 2));
      std::vector<std::vector<BiasedKey>> biased(static_cast<size_t>(run), {no_bias});
      std::vector<uint64_t> immoderate(static_cast<size_t>(run));
      int64_t listed_run =
          -1;  // whose lists `biased` holds: the heads of a run follow each other and share them
      for (int64_t task = begin; task < end; ++task) {
        const int64_t run_index = task / heads, head = head0 + task % heads;
        const int64_t first = run_index * run, count = std::min(run, num_blocks - first);
        const bool keys_moderate = moderate[static_cast<size_t>(head - head0)];
        for (int64_t i = 0; i < count; ++i) {
          const QueryBlock& queries_of = blocks[static_cast<size_t>(first + i)];
          if (buckets && listed_run != run_index)
            biased[static_cast<size_t>(i)] = biased_keys_of_block(*buckets, queries_of);
          const uint64_t lanes = pack_queries(a, kernel.packing, sizes, base(a.q_strides, head), queries_of,
                                              scale, pairs.data(), queries.get() + i * sizes.q_bytes);
          immoderate[static_cast<size_t>(i)] = keys_moderate ? lanes : ~uint64_t{0};
        }
        listed_run = run_index;
        block.k = keys_of(head);
        block.v = keys_of(head) + sizes.k_bytes;
        for (int64_t key0 = 0; key0 < n.num_keys; key0 += panel_keys)
          for (int64_t i = 0; i < count; ++i) {
            const QueryBlock& queries_of = blocks[static_cast<size_t>(first + i)];
            block.begin_key = key0;
            block.end_key = std::min(key0 + panel_keys, n.num_keys);
            block.num_lanes = queries_of.num_lanes();
            block.biased = biased[static_cast<size_t>(i)].data();
            block.immoderate_lanes = immoderate[static_cast<size_t>(i)];
            block.q = queries.get() + i * sizes.q_bytes;
            block.state = reinterpret_cast<float*>(states.get() + i * state_bytes);
            kernel.attend(block);
            if (block.end_key < n.num_keys) continue;
            write_rows(a, base(a.out_strides, head), queries_of, block.out, rounded.data());
            if (a.log_sum_exp)
              for (int lane = 0; lane < block.num_lanes; ++lane)
                a.log_sum_exp[head * n.num_queries + queries_of.query(lane)] = block.log_sum_exp[lane];
          }
      }
    });
  }
}

}  // namespace patina::attention
