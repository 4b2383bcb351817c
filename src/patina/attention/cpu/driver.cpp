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

#include "patina/attention/cpu/kernel.h"
#include "patina/attention/cpu/transpose.h"
#include "patina/attention/query_blocks.h"
#include "patina/base/bf16.h"
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

/// How a call is cut: heads into groups, keys into panels, blocks of queries into runs.
struct Cut {
  int64_t num_heads;   // every (batch, head) pair
  int64_t head_bytes;  // packed keys and values of one
  int64_t group;       // heads that are packed at a time
  int64_t panel_keys;
  int64_t state_bytes;  // of one block
  int64_t run;          // blocks
  int64_t num_runs;
};
Cut cut_of(const Shape& n, const Kernel& kernel, const PackedSizes& sizes, int64_t num_blocks) {
  Cut cut{};
  cut.num_heads = n.batch * n.num_heads;
  cut.head_bytes = sizes.k_bytes + sizes.v_bytes;
  cut.group = std::clamp<int64_t>(kGroupBytes / cut.head_bytes, 1, cut.num_heads);
  cut.panel_keys =
      kernel.takes_panels
          ? std::max(kPanelKeys, kPanelBytes * sizes.keys / cut.head_bytes / kPanelKeys * kPanelKeys)
          : n.num_keys;
  cut.state_bytes = kernel.state_floats ? kernel.state_floats(static_cast<int>(n.head_dim)) * 4 : 0;
  // As long a run as fits, if that leaves a few tasks to each thread; of one block where there is one panel.
  cut.run = cut.panel_keys >= n.num_keys
                ? 1
                : std::clamp<int64_t>(std::min(kRunBytes / (cut.state_bytes + sizes.q_bytes),
                                               num_blocks * cut.num_heads / (int64_t{4} * num_threads())),
                                      1, num_blocks);
  cut.num_runs = (num_blocks + cut.run - 1) / cut.run;
  return cut;
}

/// What one thread works in: the queries of a run, their states, biased keys and results.
struct Workspace {
  Workspace(const Cut& cut, const PackedSizes& sizes, const Shape& n)
      : out_floats(round_up(n.head_dim, 16) * kBlockQueries),
        queries(aligned_bytes(cut.run * sizes.q_bytes)),
        states(aligned_bytes(cut.run * cut.state_bytes)),
        floats(aligned_bytes((kScratchFloats + out_floats + kBlockQueries) * 4)),
        rounded(static_cast<size_t>(out_floats)),
        pairs(static_cast<size_t>(out_floats / 2)),
        biased(static_cast<size_t>(cut.run), {BiasedKey{std::numeric_limits<int32_t>::max(), 0}}),
        immoderate(static_cast<size_t>(cut.run)) {
    block.scratch = reinterpret_cast<float*>(floats.get());
    block.out = block.scratch + kScratchFloats;
    block.log_sum_exp = block.out + out_floats;
    block.num_keys = n.num_keys;
    block.head_dim = static_cast<int>(n.head_dim);
  }

  int64_t out_floats;
  AlignedBytes queries, states, floats;
  std::vector<uint16_t> rounded;
  std::vector<uint32_t> pairs;
  std::vector<std::vector<BiasedKey>> biased;
  int64_t listed_run = -1;  // whose lists `biased` holds: the heads of a run follow each other and share them
  std::vector<uint64_t> immoderate;
  Block block;
};

/// One call: packs a group of heads, attends all queries to it, and goes on to the next group.
class Driver {
 public:
  Driver(const Arguments& arguments, const Kernel& kernel)
      : a_(arguments),
        kernel_(kernel),
        buckets_(a_.beta != 0 ? a_.buckets : nullptr),
        blocks_(make_query_blocks(a_.shape.num_queries, buckets_)),
        sizes_(packed_sizes(kernel.packing, a_.shape.num_keys, a_.shape.head_dim)),
        cut_(cut_of(a_.shape, kernel, sizes_, static_cast<int64_t>(blocks_.size()))),
        scale_(in_log_2(a_.scale)),
        beta_(in_log_2(a_.beta)),
        packed_(aligned_bytes(cut_.group * cut_.head_bytes)),
        moderate_(static_cast<size_t>(cut_.group)) {}

  void run() {
    for (head0_ = 0; head0_ < cut_.num_heads; head0_ += cut_.group) {
      heads_ = std::min(cut_.group, cut_.num_heads - head0_);
      pack_group();
      attend_group();
    }
  }

 private:
  /// Scores live in units of log 2, so that the softmax needs 2^x.
  static float in_log_2(float value) {
    return static_cast<float>(static_cast<double>(value) * std::numbers::log2e);
  }
  int64_t base(const Strides& s, int64_t head) const {
    return head / a_.shape.num_heads * s.batch + head % a_.shape.num_heads * s.head;
  }
  std::byte* keys_of(int64_t head) const { return packed_.get() + (head - head0_) * cut_.head_bytes; }
  std::byte* values_of(int64_t head) const { return keys_of(head) + sizes_.k_bytes; }

  void pack_group() {
    for (std::atomic<bool>& m : moderate_) m = true;
    constexpr int64_t kChunk = 1024;  // keys a task, a multiple of kPanelKeys
    const int64_t num_keys = a_.shape.num_keys, chunks = (num_keys + kChunk - 1) / kChunk;
    parallel_for(0, heads_ * chunks, 1, [&](int64_t begin, int64_t end) {
      for (int64_t task = begin; task < end; ++task) {
        const int64_t head = head0_ + task / chunks, key0 = task % chunks * kChunk;
        if (!pack_keys_values(a_, kernel_.packing, sizes_, base(a_.k_strides, head), base(a_.v_strides, head),
                              key0, std::min(key0 + kChunk, num_keys), keys_of(head), values_of(head)))
          moderate_[static_cast<size_t>(head - head0_)] = false;
      }
    });
  }

  void attend_group() {
    parallel_for(0, cut_.num_runs * heads_, 1, [&](int64_t begin, int64_t end) {
      Workspace work(cut_, sizes_, a_.shape);
      work.block.score_scale = kernel_.packing == Packing::kF32 ? 1.0f : scale_;
      work.block.beta = beta_;
      for (int64_t task = begin; task < end; ++task) {
        const int64_t run = task / heads_, head = head0_ + task % heads_;
        pack_run(run, head, work);
        attend_run(run, head, work);
      }
    });
  }

  int64_t first_block(int64_t run) const { return run * cut_.run; }
  int64_t num_blocks(int64_t run) const {
    return std::min(cut_.run, static_cast<int64_t>(blocks_.size()) - first_block(run));
  }
  const QueryBlock& block_of(int64_t run, int64_t i) const {
    return blocks_[static_cast<size_t>(first_block(run) + i)];
  }

  void pack_run(int64_t run, int64_t head, Workspace& work) const {
    const bool keys_moderate = moderate_[static_cast<size_t>(head - head0_)];
    for (int64_t i = 0; i < num_blocks(run); ++i) {
      const QueryBlock& queries = block_of(run, i);
      if (buckets_ && work.listed_run != run)
        work.biased[static_cast<size_t>(i)] = biased_keys_of_block(*buckets_, queries);
      const uint64_t lanes = pack_queries(a_, kernel_.packing, sizes_, base(a_.q_strides, head), queries,
                                          scale_, work.pairs.data(), work.queries.get() + i * sizes_.q_bytes);
      work.immoderate[static_cast<size_t>(i)] = keys_moderate ? lanes : ~uint64_t{0};
    }
    work.listed_run = run;
  }

  void attend_run(int64_t run, int64_t head, Workspace& work) const {
    Block& block = work.block;
    block.k = keys_of(head);
    block.v = values_of(head);
    for (int64_t key0 = 0; key0 < block.num_keys; key0 += cut_.panel_keys)
      for (int64_t i = 0; i < num_blocks(run); ++i) {
        const QueryBlock& queries = block_of(run, i);
        block.begin_key = key0;
        block.end_key = std::min(key0 + cut_.panel_keys, block.num_keys);
        block.num_lanes = queries.num_lanes();
        block.biased = work.biased[static_cast<size_t>(i)].data();
        block.immoderate_lanes = work.immoderate[static_cast<size_t>(i)];
        block.q = work.queries.get() + i * sizes_.q_bytes;
        block.state = reinterpret_cast<float*>(work.states.get() + i * cut_.state_bytes);
        kernel_.attend(block);
        if (block.end_key == block.num_keys) write_results(head, queries, work);
      }
  }

  void write_results(int64_t head, const QueryBlock& queries, Workspace& work) const {
    write_rows(a_, base(a_.out_strides, head), queries, work.block.out, work.rounded.data());
    if (!a_.log_sum_exp) return;
    for (int lane = 0; lane < work.block.num_lanes; ++lane)
      a_.log_sum_exp[head * a_.shape.num_queries + queries.query(lane)] = work.block.log_sum_exp[lane];
  }

  const Arguments& a_;
  const Kernel& kernel_;
  const KeyBuckets* buckets_;
  const std::vector<QueryBlock> blocks_;
  const PackedSizes sizes_;
  const Cut cut_;
  const float scale_, beta_;
  const AlignedBytes packed_;                // keys and values of the group's heads
  std::vector<std::atomic<bool>> moderate_;  // one a head of the group
  int64_t head0_ = 0, heads_ = 0;            // the group
};

}  // namespace

void run_blocks(const Arguments& a, const Kernel& kernel) {
  Driver(a, kernel).run();
}

}  // namespace patina::attention
