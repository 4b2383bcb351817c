// AMX tiles: configuration, and the products of the plain online-softmax kernel (flash_bf16.inl), which takes
// over the rows that the fast one gives up; included inside flash_amx_bf16.cpp's anonymous namespace.

/// The operand of LDTILECFG: eight tiles of 16 rows of 64 bytes.
struct alignas(64) TileConfig {
  uint8_t palette = 1, start_row = 0, reserved[14] = {};
  uint16_t row_bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
  uint8_t rows[16] = {16, 16, 16, 16, 16, 16, 16, 16};
};
static_assert(sizeof(TileConfig) == 64);
constexpr TileConfig kTileConfig;  // in memory: GCC 12 drops stores to a local that only LDTILECFG reads

constexpr int64_t kTileBytes = 1024;
constexpr int kTileFloats = 256;

/// Steps of 32 dimensions of a score, and tiles of 16 rows of a value with its row of ones.
inline int score_steps(int head_dim) {
  return (head_dim + 31) / 32;
}
inline int value_tiles(int head_dim) {
  return head_dim / 16 + 1;
}

/// For attend_bf16. Tiles 0 to 3 sum a 2 × 2 group of results, 4 and 5 hold rows (keys or value dimensions),
/// 6 and 7 lanes.
struct TileProducts {
  static constexpr int kTileKeys = 96, kKeyStep = 32;
  int head_dim, steps, values_tiles;

  explicit TileProducts(int dim) : head_dim(dim), steps(score_steps(dim)), values_tiles(value_tiles(dim)) {}

  /// Writes whole groups of 32 keys: rows past `tile` hold scores of zero keys and are not read.
  void scores(const Block& block, int64_t key0, int tile, float* s) const {
    constexpr int64_t kLaneBytes = kLanes * 4;
    for (int j = 0; j < tile; j += 32)
      for (int lane = 0; lane < block.num_lanes; lane += 32) {
        const char* k = static_cast<const char*>(block.k) + (key0 + j) / 16 * steps * kTileBytes;
        const char* q = static_cast<const char*>(block.q) + lane / 16 * steps * kTileBytes;
        _tile_zero(0);
        _tile_zero(1);
        _tile_zero(2);
        _tile_zero(3);
        for (int i = 0; i < steps; ++i, k += kTileBytes, q += kTileBytes) {
          _tile_loadd(4, k, 64);
          _tile_loadd(6, q, 64);
          _tile_dpbf16ps(0, 4, 6);
          _tile_loadd(7, q + steps * kTileBytes, 64);
          _tile_dpbf16ps(1, 4, 7);
          _tile_loadd(5, k + steps * kTileBytes, 64);
          _tile_dpbf16ps(2, 5, 6);
          _tile_dpbf16ps(3, 5, 7);
        }
        float* to = s + j * kLanes + lane;
        _tile_stored(0, to, kLaneBytes);
        _tile_stored(1, to + 16, kLaneBytes);
        _tile_stored(2, to + 16 * kLanes, kLaneBytes);
        _tile_stored(3, to + 16 * kLanes + 16, kLaneBytes);
      }
  }

  /// Products of this tile go through `work` [16][64], which held the scores.
  void values(const Block& block, int64_t key0, int tile, const uint32_t* p, const Vec16* decay, bool first,
              float* work) const {
    constexpr int64_t kLaneBytes = kLanes * 4;
    const int columns = (block.num_lanes + 15) / 16;
    for (int row = 0; row < head_dim; row += 16) {
      for (int lane = 0; lane < block.num_lanes; lane += 16) {
        const char* v =
            static_cast<const char*>(block.v) + (key0 / 32 * values_tiles + row / 16) * kTileBytes;
        _tile_zero(0);
        for (int j = 0; j < tile; j += 32, v += values_tiles * kTileBytes) {
          _tile_loadd(4, v, 64);
          _tile_loadd(6, p + j / 2 * kLanes + lane, kLaneBytes);
          _tile_dpbf16ps(0, 4, 6);
        }
        _tile_stored(0, work + lane, kLaneBytes);
      }
      const int rows = head_dim - row < 16 ? head_dim - row : 16;
      for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) {
          float* at = block.out + (row + r) * kLanes + c * 16;
          const Vec16 tile_sum = Vec16::load(work + r * kLanes + c * 16);
          (first ? tile_sum : fma(Vec16::load(at), decay[c], tile_sum)).store(at);
        }
    }
  }
};
