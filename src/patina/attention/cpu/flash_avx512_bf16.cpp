// The bf16 kernel on AVX-512 with VDPBF16PS: two products a lane and instruction, f32 sums.
#include <immintrin.h>

#include <cstdint>

#include "patina/attention/cpu/kernel.h"

namespace patina::attention {
namespace {

// Each stands on those above it.
#include "patina/attention/cpu/vec16.inl"

#include "patina/attention/cpu/exp2.inl"
#include "patina/attention/cpu/rows.inl"

#include "patina/attention/cpu/flash_bf16.inl"

inline __attribute__((always_inline)) __m512 dot_pairs(__m512 sum, uint32_t pair, __m512i lanes) {
  return _mm512_dpbf16_ps(sum, reinterpret_cast<__m512bh>(_mm512_set1_epi32(static_cast<int>(pair))),
                          reinterpret_cast<__m512bh>(lanes));
}

struct PairProducts {
  static constexpr int kTileKeys = 96, kKeyStep = 2, kRows = 6;  // 24 of 32 registers accumulate
  int head_dim, num_pairs;

  explicit PairProducts(int dim) : head_dim(dim), num_pairs((dim + 1) / 2) {}

  /// R rows by 64 lanes: sum[r] = Σ_i pairs(row r, i) · lanes(i).
  template <int R, class RowPair>
  static inline __attribute__((always_inline)) void multiply(int count, const uint32_t* lanes,
                                                             const RowPair& pair, __m512 (&sum)[R][4]) {
    for (int r = 0; r < R; ++r)
      for (int c = 0; c < 4; ++c) sum[r][c] = _mm512_setzero_ps();
    for (int i = 0; i < count; ++i) {
      __m512i column[4];
      for (int c = 0; c < 4; ++c) column[c] = _mm512_load_si512(lanes + i * kLanes + c * 16);
#pragma GCC unroll 8
      for (int r = 0; r < R; ++r) {
        const uint32_t broadcast = pair(r, i);
        for (int c = 0; c < 4; ++c) sum[r][c] = dot_pairs(sum[r][c], broadcast, column[c]);
      }
    }
  }

  void scores(const Block& block, int64_t key0, int tile, float* s) const {
    const uint32_t* q = static_cast<const uint32_t*>(block.q);
    const uint32_t* k = static_cast<const uint32_t*>(block.k) + key0 * num_pairs;
    for_rows<kRows>(tile, [&]<int R>(int j) {
      __m512 sum[R][4];
      const uint32_t* rows = k + static_cast<int64_t>(j) * num_pairs;
      multiply<R>(
          num_pairs, q, [&](int r, int i) { return rows[r * num_pairs + i]; }, sum);
      for (int r = 0; r < R; ++r)
        for (int c = 0; c < 4; ++c) _mm512_store_ps(s + (j + r) * kLanes + c * 16, sum[r][c]);
    });
  }

  void values(const Block& block, int64_t key0, int tile, const uint32_t* p, const Vec16* decay, bool first,
              float*) const {
    const uint32_t* v = static_cast<const uint32_t*>(block.v) + key0 / 2 * head_dim;
    for_rows<kRows>(head_dim, [&]<int R>(int row) {
      __m512 sum[R][4];
      multiply<R>((tile + 1) / 2, p,
                  [&](int r, int i) { return v[static_cast<int64_t>(i) * head_dim + row + r]; }, sum);
      for (int r = 0; r < R; ++r)
        for (int c = 0; c < 4; ++c) {
          float* at = block.out + (row + r) * kLanes + c * 16;
          const Vec16 tile_sum{sum[r][c]};
          (first ? tile_sum : fma(Vec16::load(at), decay[c], tile_sum)).store(at);
        }
    });
  }
};

}  // namespace

Kernel avx512_bf16_kernel() {
  return {Packing::kBf16Pairs, false, nullptr, attend_bf16<PairProducts>};
}

}  // namespace patina::attention
