// The kernel of sparse_merge, as one thread of it runs it: all indices and arithmetic, written once. `Gpu`
// supplies what only a GPU has; sparse_merge.cuh has the real one, tools/emulated_gpu/emulated_gpu.h one that
// runs a whole block of threads on the CPU.
//
// The dense result is the state of an online softmax [Milakov2018] that has seen every key: maximum L, sum
// 1, output O. The kernel lets it see the biased keys once more, with weight (e^β − 1) e^s. So a row needs no
// maximum of its own, terms are at most about e^β − 1, and what overflow is left to guard against happens for
// large β alone. A block is 64 queries of one head, four warps of 16; it gathers tiles of 32 biased keys and
// values, double-buffered or better, and works as [Dao2024] does within a warp: scores and weights stay in
// registers, whose layout as the result of one product is that of an operand of the next.
#pragma once

#include <cstdint>

#include "patina/attention/cuda/sparse_merge.h"

#if defined(__CUDACC__)
#define PATINA_DEVICE __device__ __forceinline__
#define PATINA_UNROLL _Pragma("unroll")
#else
#define PATINA_DEVICE inline
#define PATINA_UNROLL
#endif

namespace patina::attention::cuda {

inline constexpr int kWarps = kBlockLanes / kWarpLanes, kThreads = 32 * kWarps;
inline constexpr int kPieceElements = 8;   // rows are copied in pieces of 16 bytes
inline constexpr float kHeadroomLog2 = 8;  // weights up to 2^8 need no new maximum; fp16 holds 2^16
inline constexpr float kLn2 = 0.69314718056f, kLog2E = 1.44269504089f;

/// Shared memory, by byte offsets: queries, then `kStages` pairs of a tile of keys and one of values.
/// kPieces: 16-byte pieces that a row has room for, head_dim / 8 rounded up.
template <int kPieces>
struct SharedLayout {
  // An odd number of pieces a row: the eight rows that one matrix load reads then lie on different banks.
  static constexpr int kRowBytes = (kPieces | 1) * 16;
  static constexpr int kTileBytes = kTileKeys * kRowBytes;
  static constexpr int kStages = kPieces <= 10 ? 3 : 2;
  static constexpr int kBytes = kBlockLanes * kRowBytes + 2 * kStages * kTileBytes;

  static constexpr uint32_t kQueries = 0;
  static PATINA_DEVICE uint32_t keys(int stage) {
    return static_cast<uint32_t>(kBlockLanes * kRowBytes + 2 * stage * kTileBytes);
  }
  static PATINA_DEVICE uint32_t values(int stage) { return keys(stage) + kTileBytes; }
  static PATINA_DEVICE uint32_t piece(int row, int piece) {
    return static_cast<uint32_t>(row * kRowBytes + piece * 16);
  }
};

/// Calls f.operator()<kPieces>() with the fewest pieces that hold head_dim among those that are compiled: the
/// head dimensions of the networks, and steps between them that pad little. Padding is zeros.
template <class F>
void dispatch_pieces(int64_t head_dim, F f) {
  if (head_dim <= 40) return f.template operator()<5>();
  if (head_dim <= 64) return f.template operator()<8>();
  if (head_dim <= 80) return f.template operator()<10>();
  if (head_dim <= 96) return f.template operator()<12>();
  if (head_dim <= 128) return f.template operator()<16>();
  if (head_dim <= 160) return f.template operator()<20>();
  if (head_dim <= 192) return f.template operator()<24>();
  return f.template operator()<32>();
}

/// One head of one batch.
struct HeadPointers {
  const uint16_t* q;
  const uint16_t* k;
  const uint16_t* v;
  uint16_t* out;
  float* log_sum_exp;
};
PATINA_DEVICE HeadPointers head_pointers(const SparseMerge& merge, int64_t batch, int64_t head) {
  const auto at = [&](const Strides& strides) { return batch * strides.batch + head * strides.head; };
  return {static_cast<const uint16_t*>(merge.q) + at(merge.q_strides),
          static_cast<const uint16_t*>(merge.k) + at(merge.k_strides),
          static_cast<const uint16_t*>(merge.v) + at(merge.v_strides),
          static_cast<uint16_t*>(merge.out) + at(merge.out_strides),
          merge.log_sum_exp + at(merge.log_sum_exp_strides)};
}

/// Starts copying the block's queries; lanes and pieces that there are not become zeros.
template <int kPieces, class Gpu>
PATINA_DEVICE void copy_queries(Gpu& gpu, const SparseMerge& merge, const TiledBlock& block,
                                const uint16_t* q) {
  using Shared = SharedLayout<kPieces>;
  const int pieces = static_cast<int>(merge.shape.head_dim) / kPieceElements;
  for (int i = gpu.thread(); i < kBlockLanes * kPieces; i += kThreads) {
    const int lane = i / kPieces, piece = i % kPieces;
    const bool exists = lane < block.num_lanes && piece < pieces;
    const uint16_t* from = q;
    if (exists) from += block.query(lane, merge.row_stride) * merge.q_strides.token + piece * kPieceElements;
    gpu.copy16(Shared::kQueries + Shared::piece(lane, piece), from, exists);
  }
}

/// Starts copying a tile of keys and values. `key` is the tile's key of this thread's place in its warp:
/// thread l of every warp holds the l-th.
template <int kPieces, class Gpu>
PATINA_DEVICE void copy_tile(Gpu& gpu, const SparseMerge& merge, const HeadPointers& head, int32_t key,
                             int stage) {
  using Shared = SharedLayout<kPieces>;
  const int pieces = static_cast<int>(merge.shape.head_dim) / kPieceElements;
  // 32 rows: whole warps take part in each turn, as the shuffle needs.
  PATINA_UNROLL
  for (int first = 0; first < kTileKeys * kPieces; first += kThreads) {
    const int i = first + gpu.thread();
    if (i >= kTileKeys * kPieces) break;
    const int row = i / kPieces, piece = i % kPieces;
    const int64_t token = static_cast<int64_t>(gpu.shuffle(static_cast<uint32_t>(key), row));
    const bool exists = piece < pieces;
    const int offset = exists ? piece * kPieceElements : 0;
    const uint32_t to = Shared::piece(row, piece);
    gpu.copy16(Shared::keys(stage) + to, head.k + token * merge.k_strides.token + offset, exists);
    gpu.copy16(Shared::values(stage) + to, head.v + token * merge.v_strides.token + offset, exists);
  }
}

// Where a thread's address points in a load of four 8 × 8 matrices: threads 8m to 8m+7 name the rows of
// matrix m. "down" and "right" say where matrix m lies among the four.
struct MatrixPlace {
  int row, piece;
};
/// Matrices 0, 1 below each other, 2, 3 to the right of them: an operand A, or a transposed B.
PATINA_DEVICE MatrixPlace down_then_right(int lane) {
  return {lane % 8 + lane / 8 % 2 * 8, lane / 16};
}
/// Matrices 0, 1 beside each other, 2, 3 below them: an operand B.
PATINA_DEVICE MatrixPlace right_then_down(int lane) {
  return {lane % 8 + lane / 16 * 8, lane / 8 % 2};
}

/// The query operand of one step of 16 dimensions, or of the last 8 (then its first half counts).
template <int kPieces, class Gpu>
PATINA_DEVICE void load_query(Gpu& gpu, int step, uint32_t (&a)[4]) {
  using Shared = SharedLayout<kPieces>;
  const int lane = gpu.thread() % 32, warp = gpu.thread() / 32;
  const MatrixPlace place = down_then_right(lane);
  // For the last 8 dimensions the right matrices repeat the left ones and go unused.
  const int piece = 2 * step + (2 * step + 1 < kPieces ? place.piece : 0);
  gpu.load_matrices(a, Shared::kQueries + Shared::piece(warp * kWarpLanes + place.row, piece));
}

/// scores[n][e] of the warp's 16 queries and the tile's keys: query lane/4 + 8 (e/2), key 8n + 2 (lane%4)
/// + e%2. `queries` holds the operands of all steps, or they are loaded anew.
template <int kPieces, bool kQueriesInRegisters, class Gpu>
PATINA_DEVICE void multiply_scores(Gpu& gpu, int stage, const uint32_t (*queries)[4], float (&scores)[4][4]) {
  using Shared = SharedLayout<kPieces>;
  const int lane = gpu.thread() % 32;
  PATINA_UNROLL
  for (int n = 0; n < 4; ++n) PATINA_UNROLL
  for (int e = 0; e < 4; ++e) scores[n][e] = 0;
  const MatrixPlace place = right_then_down(lane);
  PATINA_UNROLL
  for (int step = 0; step < (kPieces + 1) / 2; ++step) {
    uint32_t a[4];
    if constexpr (kQueriesInRegisters) {
      PATINA_UNROLL
      for (int i = 0; i < 4; ++i) a[i] = queries[step][i];
    } else {
      load_query<kPieces>(gpu, step, a);
    }
    if (2 * step + 1 < kPieces) {
      PATINA_UNROLL
      for (int half = 0; half < 2; ++half) {
        uint32_t b[4];
        gpu.load_matrices(b,
                          Shared::keys(stage) + Shared::piece(16 * half + place.row, 2 * step + place.piece));
        gpu.multiply16(scores[2 * half], a, b[0], b[1]);
        gpu.multiply16(scores[2 * half + 1], a, b[2], b[3]);
      }
    } else {  // the last 8 dimensions of all 32 keys
      uint32_t b[4];
      gpu.load_matrices(b, Shared::keys(stage) + Shared::piece(lane, 2 * step));
      PATINA_UNROLL
      for (int n = 0; n < 4; ++n) gpu.multiply8(scores[n], a[0], a[1], b[n]);
    }
  }
}

/// A thread's two rows, lane/4 and lane/4 + 8 of its warp, as the online softmax sees them.
struct RowState {
  float shift[2];   // what brings a score in powers of 2 to its weight: log2_weight − maximum
  float raised[2];  // how far the maximum went above the dense log-sum-exp
  float sum[2];     // of the weights of this thread's columns
};

/// Scores -> weights relative to the row's maximum, 0 where the bias does not hold. `masks`: the words of the
/// thread's two rows. Where a weight would be large, raises the maximum and scales what was summed.
template <int kPieces, class Gpu>
PATINA_DEVICE void weigh(Gpu& gpu, const MergeConstants& constants, const uint32_t (&masks)[2],
                         float (&scores)[4][4], RowState& rows, float (&out)[kPieces][4]) {
  const int first_column = gpu.thread() % 4 * 2;
  const uint32_t mine[2] = {masks[0] >> first_column, masks[1] >> first_column};
  float largest[2] = {-gpu.infinity(), -gpu.infinity()};
  PATINA_UNROLL
  for (int n = 0; n < 4; ++n) PATINA_UNROLL
  for (int e = 0; e < 4; ++e) {
    const int r = e / 2;
    const bool biased = (mine[r] >> (8 * n + e % 2)) & 1;
    scores[n][e] =
        biased ? gpu.multiply_add(scores[n][e], constants.score_scale, rows.shift[r]) : -gpu.infinity();
    largest[r] = gpu.max(largest[r], scores[n][e]);
  }

  if (gpu.any(gpu.max(largest[0], largest[1]) > kHeadroomLog2)) {
    float raise[2];
    PATINA_UNROLL
    for (int r = 0; r < 2; ++r) {
      // The four threads of a row agree; a row that needs no raise gets none, whatever its neighbours need.
      largest[r] = gpu.max(largest[r], gpu.exchange(largest[r], 1));
      largest[r] = gpu.max(largest[r], gpu.exchange(largest[r], 2));
      raise[r] = largest[r] > kHeadroomLog2 ? largest[r] : 0.0f;
      const float factor = gpu.exp2(-raise[r]);
      rows.shift[r] -= raise[r];
      rows.raised[r] += raise[r];
      rows.sum[r] *= factor;
      PATINA_UNROLL
      for (int p = 0; p < kPieces; ++p) out[p][2 * r] *= factor, out[p][2 * r + 1] *= factor;
    }
    PATINA_UNROLL
    for (int n = 0; n < 4; ++n) PATINA_UNROLL
    for (int e = 0; e < 4; ++e) scores[n][e] -= raise[e / 2];
  }

  PATINA_UNROLL
  for (int n = 0; n < 4; ++n) PATINA_UNROLL
  for (int e = 0; e < 4; ++e) {
    scores[n][e] = gpu.exp2(scores[n][e]);
    rows.sum[e / 2] += scores[n][e];
  }
}

/// out[p][e] += weights · values: query lane/4 + 8 (e/2), dimension 8p + 2 (lane%4) + e%2.
template <int kPieces, class Gpu>
PATINA_DEVICE void multiply_values(Gpu& gpu, int stage, const float (&weights)[4][4],
                                   float (&out)[kPieces][4]) {
  using Shared = SharedLayout<kPieces>;
  const int lane = gpu.thread() % 32;
  // Two results of 8 keys each are, in 16 bits, one operand of 16 keys.
  uint32_t a[2][4];
  PATINA_UNROLL
  for (int half = 0; half < 2; ++half) PATINA_UNROLL
  for (int i = 0; i < 4; ++i)
    a[half][i] = gpu.pack(weights[2 * half + i / 2][2 * (i % 2)], weights[2 * half + i / 2][2 * (i % 2) + 1]);

  const MatrixPlace place = down_then_right(lane);
  PATINA_UNROLL
  for (int p = 0; p + 1 < kPieces; p += 2) PATINA_UNROLL
  for (int half = 0; half < 2; ++half) {
    uint32_t b[4];
    gpu.load_transposed(b, Shared::values(stage) + Shared::piece(16 * half + place.row, p + place.piece));
    gpu.multiply16(out[p], a[half], b[0], b[1]);
    gpu.multiply16(out[p + 1], a[half], b[2], b[3]);
  }
  if constexpr (kPieces % 2 == 1) {  // the last 8 dimensions of all 32 keys
    uint32_t b[4];
    gpu.load_transposed(b, Shared::values(stage) + Shared::piece(lane, kPieces - 1));
    gpu.multiply16(out[kPieces - 1], a[0], b[0], b[1]);
    gpu.multiply16(out[kPieces - 1], a[1], b[2], b[3]);
  }
}

/// Where one of a thread's two rows (r = 0, 1) reads the dense result and writes the biased one. Computed
/// anew at the end: nothing of it stays in registers meanwhile.
struct BlockRow {
  bool exists;
  uint16_t* out;  // at this thread's first two columns
  float* log_sum_exp;
};
PATINA_DEVICE BlockRow row_of(int thread, const SparseMerge& merge, const HeadPointers& head,
                              const TiledBlock& block, int r) {
  const int row = thread / 32 * kWarpLanes + thread % 32 / 4 + 8 * r;
  const bool exists = row < block.num_lanes;
  const int64_t query = exists ? block.query(row, merge.row_stride) : 0;
  return {exists, head.out + query * merge.out_strides.token + thread % 4 * 2,
          head.log_sum_exp + query * merge.log_sum_exp_strides.token};
}

/// The online softmax after all keys: its output is the dense one, its maximum the dense log-sum-exp.
template <int kPieces, class Gpu>
PATINA_DEVICE RowState start_from_dense(Gpu& gpu, const SparseMerge& merge, const MergeConstants& constants,
                                        const HeadPointers& head, const TiledBlock& block,
                                        float (&out)[kPieces][4]) {
  const int pieces = static_cast<int>(merge.shape.head_dim) / kPieceElements;
  RowState rows;
  PATINA_UNROLL
  for (int r = 0; r < 2; ++r) {
    const BlockRow row = row_of(gpu.thread(), merge, head, block, r);
    const float log_sum_exp = row.exists ? *row.log_sum_exp : 0.0f;
    rows.shift[r] = constants.log2_weight - log_sum_exp * kLog2E;
    rows.raised[r] = rows.sum[r] = 0;
    PATINA_UNROLL
    for (int p = 0; p < kPieces; ++p) {
      float two[2] = {0, 0};
      if (row.exists && p < pieces) gpu.load_pair(row.out + p * kPieceElements, two);
      out[p][2 * r] = constants.dense_sign * two[0];
      out[p][2 * r + 1] = constants.dense_sign * two[1];
    }
  }
  return rows;
}

/// Divides by the sum and writes the rows and their log-sum-exp.
template <int kPieces, class Gpu>
PATINA_DEVICE void finish(Gpu& gpu, const SparseMerge& merge, const MergeConstants& constants,
                          const HeadPointers& head, const TiledBlock& block, const RowState& rows,
                          const float (&out)[kPieces][4]) {
  const int pieces = static_cast<int>(merge.shape.head_dim) / kPieceElements;
  PATINA_UNROLL
  for (int r = 0; r < 2; ++r) {
    float sum = rows.sum[r];
    sum += gpu.exchange(sum, 1);
    sum += gpu.exchange(sum, 2);
    sum += constants.dense_sign * gpu.exp2(-rows.raised[r]);
    const float factor = 1.0f / sum;
    const BlockRow row = row_of(gpu.thread(), merge, head, block, r);
    if (!row.exists) continue;
    PATINA_UNROLL
    for (int p = 0; p < kPieces; ++p)
      if (p < pieces)
        gpu.store_pair(row.out + p * kPieceElements, out[p][2 * r] * factor, out[p][2 * r + 1] * factor);
    if (gpu.thread() % 4 == 0)
      *row.log_sum_exp += kLn2 * (rows.raised[r] + gpu.log2(constants.dense_sign * sum));
  }
}

/// The whole work of one thread for one (query block, head, batch).
template <int kPieces, class Gpu>
PATINA_DEVICE void merge_block(Gpu& gpu, const SparseMerge& merge, const MergeConstants& constants,
                               int block_index, int head_index, int batch) {
  constexpr int kStages = SharedLayout<kPieces>::kStages;
  // 16 dimensions take four registers; beyond 128 dimensions the output needs them.
  constexpr bool kQueriesInRegisters = kPieces <= 16;
  const TiledBlock block = merge.blocks[block_index];
  const HeadPointers head = head_pointers(merge, batch, head_index);
  const int lane = gpu.thread() % 32, warp = gpu.thread() / 32;
  const int32_t* keys = merge.keys + static_cast<int64_t>(block.first_tile) * kTileKeys + lane;
  const uint32_t* masks =
      merge.masks + static_cast<int64_t>(block.first_tile) * kBlockLanes + warp * kWarpLanes + lane / 4;

  // Fill the pipeline: tile t is in flight from kStages − 1 tiles before it is used, its keys' indices one
  // longer. Groups of copies are counted, so empty ones are committed too.
  copy_queries<kPieces>(gpu, merge, block, head.q);
  PATINA_UNROLL
  for (int tile = 0; tile < kStages - 1; ++tile) {
    if (tile < block.num_tiles) copy_tile<kPieces>(gpu, merge, head, keys[tile * kTileKeys], tile);
    gpu.commit_copies();
  }
  int32_t next_key = kStages - 1 < block.num_tiles ? keys[(kStages - 1) * kTileKeys] : 0;
  uint32_t next_masks[2] = {masks[0], masks[8]};
  float out[kPieces][4];
  RowState rows = start_from_dense<kPieces>(gpu, merge, constants, head, block, out);

  uint32_t query_operands[kQueriesInRegisters ? (kPieces + 1) / 2 : 1][4];
  for (int tile = 0; tile < block.num_tiles; ++tile) {
    // This tile has arrived, for every thread, and no thread reads the buffer that is filled next.
    gpu.template wait_copies<kStages - 2>();
    gpu.barrier();
    if constexpr (kQueriesInRegisters) {
      if (tile == 0) {
        PATINA_UNROLL
        for (int step = 0; step < (kPieces + 1) / 2; ++step)
          load_query<kPieces>(gpu, step, query_operands[step]);
      }
    }
    const int ahead = tile + kStages - 1;
    if (ahead < block.num_tiles) copy_tile<kPieces>(gpu, merge, head, next_key, ahead % kStages);
    gpu.commit_copies();
    if (ahead + 1 < block.num_tiles) next_key = keys[(ahead + 1) * kTileKeys];
    const uint32_t tile_masks[2] = {next_masks[0], next_masks[1]};
    if (tile + 1 < block.num_tiles) {
      next_masks[0] = masks[(tile + 1) * kBlockLanes];
      next_masks[1] = masks[(tile + 1) * kBlockLanes + 8];
    }

    // Lists are ordered so that a warp often has nothing to do with a whole tile.
    if (!gpu.any((tile_masks[0] | tile_masks[1]) != 0)) continue;
    float scores[4][4];
    multiply_scores<kPieces, kQueriesInRegisters>(gpu, tile % kStages, query_operands, scores);
    weigh<kPieces>(gpu, constants, tile_masks, scores, rows, out);
    multiply_values<kPieces>(gpu, tile % kStages, scores, out);
  }
  finish<kPieces>(gpu, merge, constants, head, block, rows, out);
}

}  // namespace patina::attention::cuda
