// The bf16 kernel on AMX: products of 16 × 32 by 32 × 16 tiles, softmax on AVX-512.
#include <immintrin.h>

#include <cstdint>

#include "patina/attention/cpu/kernel.h"

namespace patina::attention {
namespace {

// Each stands on those above it.
#include "patina/attention/cpu/vec16.inl"

#include "patina/attention/cpu/exp2.inl"

#include "patina/attention/cpu/flash_bf16.inl"

/// The operand of LDTILECFG: eight tiles of 16 rows of 64 bytes.
struct alignas(64) TileConfig {
  uint8_t palette = 1, start_row = 0, reserved[14] = {};
  uint16_t row_bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
  uint8_t rows[16] = {16, 16, 16, 16, 16, 16, 16, 16};
};
static_assert(sizeof(TileConfig) == 64);
constexpr TileConfig kTileConfig;  // in memory: GCC 12 drops stores to a local that only LDTILECFG reads

/// Tiles 0 to 3 sum a 2 × 2 group of results, 4 and 5 hold rows (keys or value dimensions), 6 and 7 lanes.
struct TileProducts {
  static constexpr int kTileKeys = 96, kKeyStep = 32;
  int head_dim, score_dim, value_dim;

  explicit TileProducts(int dim)
      : head_dim(dim), score_dim((dim + 31) / 32 * 32), value_dim((dim + 15) / 16 * 16) {
    _tile_loadconfig(&kTileConfig);
  }
  ~TileProducts() { _tile_release(); }
  TileProducts(const TileProducts&) = delete;
  TileProducts& operator=(const TileProducts&) = delete;

  /// kRowTiles × 16 rows by 32 lanes: to = Σ over `steps` of rows (32 columns a step, `row_step` bytes apart)
  /// times 16 rows of lane pairs.
  template <int kRowTiles>
  static inline __attribute__((always_inline)) void multiply(int steps, const char* rows, int64_t row_bytes,
                                                             int64_t tile_bytes, int64_t row_step,
                                                             const uint32_t* lanes, float* to) {
    constexpr int64_t kLaneBytes = kLanes * 4;
    _tile_zero(0);
    _tile_zero(1);
    if constexpr (kRowTiles == 2) {
      _tile_zero(2);
      _tile_zero(3);
    }
    for (int i = 0; i < steps; ++i) {
      _tile_loadd(6, lanes + i * 16 * kLanes, kLaneBytes);
      _tile_loadd(7, lanes + i * 16 * kLanes + 16, kLaneBytes);
      _tile_loadd(4, rows + i * row_step, row_bytes);
      _tile_dpbf16ps(0, 4, 6);
      _tile_dpbf16ps(1, 4, 7);
      if constexpr (kRowTiles == 2) {
        _tile_loadd(5, rows + i * row_step + tile_bytes, row_bytes);
        _tile_dpbf16ps(2, 5, 6);
        _tile_dpbf16ps(3, 5, 7);
      }
    }
    _tile_stored(0, to, kLaneBytes);
    _tile_stored(1, to + 16, kLaneBytes);
    if constexpr (kRowTiles == 2) {
      _tile_stored(2, to + 16 * kLanes, kLaneBytes);
      _tile_stored(3, to + 16 * kLanes + 16, kLaneBytes);
    }
  }

  /// Writes whole groups of 32 keys: rows past `tile` hold scores of zero keys and are not read.
  void scores(const Block& block, int64_t key0, int tile, float* s) const {
    const int64_t row_bytes = score_dim * 2;
    const char* k = static_cast<const char*>(block.k) + key0 * row_bytes;
    const uint32_t* q = static_cast<const uint32_t*>(block.q);
    for (int j = 0; j < tile; j += 32)
      for (int lane = 0; lane < block.num_lanes; lane += 32)
        multiply<2>(score_dim / 32, k + j * row_bytes, row_bytes, 16 * row_bytes, 64, q + lane,
                    s + j * kLanes + lane);
  }

  /// Products of this tile go through `work` [32][64], which held the scores.
  void values(const Block& block, int64_t key0, int tile, const uint32_t* p, const Vec16* decay, bool first,
              float* work) const {
    const char* v = static_cast<const char*>(block.v) + key0 * value_dim * 2;
    const int steps = (tile + 31) / 32;
    const int64_t step_bytes = value_dim * 64;
    for (int row = 0; row < value_dim; row += 32) {
      const bool two = row + 16 < value_dim;
      for (int lane = 0; lane < block.num_lanes; lane += 32) {
        if (two)
          multiply<2>(steps, v + row * 64, 64, 1024, step_bytes, p + lane, work + lane);
        else
          multiply<1>(steps, v + row * 64, 64, 1024, step_bytes, p + lane, work + lane);
      }
      const int rows = head_dim - row < 32 ? head_dim - row : 32;
      const int columns = (block.num_lanes + 15) / 16;
      for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) {
          float* at = block.out + (row + r) * kLanes + c * 16;
          const Vec16 tile_sum = Vec16::load(work + r * kLanes + c * 16);
          (first ? tile_sum : fma(Vec16::load(at), decay[c], tile_sum)).store(at);
        }
    }
  }
};

}  // namespace

Kernel amx_bf16_kernel() {
  return {Packing::kBf16Tiles, attend_bf16<TileProducts>};
}

}  // namespace patina::attention
