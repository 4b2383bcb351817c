// The bf16 kernel on AMX: products of 16 × 32 by 32 × 16 tiles with the softmax between them on AVX-512,
// software-pipelined so that both units work at once.
//
// The softmax has no running maximum: a row's weights are 2^(s - m) for one m, the largest of its first
// scores. bf16 has the exponents of f32, so that a later score may exceed m by 69 nats; a row that leaves the
// range is seen by its sum and done again by the online kernel, as are rows with NaN or infinities.
#include <immintrin.h>

#include <cstdint>

#include "patina/attention/cpu/kernel.h"

namespace patina::attention {
namespace {

// Each stands on those above it.
#include "patina/attention/cpu/vec16.inl"

#include "patina/attention/cpu/exp2.inl"

#include "patina/attention/cpu/flash_bf16.inl"

#include "patina/attention/cpu/amx_tiles.inl"

#define PATINA_INLINE inline __attribute__((always_inline))

// A job is 32 keys by 32 lanes of scores (2 × 2 tiles); a phase is kGroups jobs, 128 keys of one half of the
// lanes, whose values are multiplied together.
constexpr int kGroups = 4, kPhaseKeys = 32 * kGroups, kJobFloats = 4 * kTileFloats, kJobWeights = 512;

/// A block's state between panels: the softmax's offsets and the lanes' m in units of log 2, [64] each, then
/// the sums Oᵀ [4 lane tiles][value tiles][16][16].
struct State {
  float *offsets, *largest, *out;
  explicit State(float* p) : offsets(p), largest(p + kLanes), out(p + 2 * kLanes) {}
};
int64_t state_floats(int head_dim) {
  return 2 * kLanes + int64_t{4} * value_tiles(head_dim) * kTileFloats;
}

/// By the fraction's six highest bits: what a linear mantissa exceeds 2^fraction - 1 by on average, in units
/// of bf16's last place, so rounded that weights have no bias (4e-5 of a weight).
alignas(64) constexpr uint8_t kLinearExcess[64] = {
    0, 1,  1,  2,  2,  3,  3,  4,  4,  5,  5,  6,  6,  6,  7,  7,  8,  8,  8,  9,  9,  9,
    9, 10, 10, 10, 10, 10, 10, 11, 11, 11, 11, 11, 11, 11, 11, 11, 10, 10, 10, 10, 10, 10,
    9, 9,  9,  9,  8,  8,  8,  7,  7,  6,  6,  5,  5,  4,  4,  3,  2,  2,  1,  0};

/// Turns the scores of one job into weights, a pair of keys at a time, so that it can be dealt out between
/// tile products.
///
/// 2^(s - m) in bf16 without a polynomial: a multiply-add with 1.5 · 2²³ as the last addend leaves
/// round(256 · (s - m + 127)) in the low bits; saturated to 16 bits and shifted right by one these are the
/// exponent and a linear mantissa, from which a table lookup by the fraction takes the error of linearity
/// (as in [Schraudolph1999], corrected). Relative error at most 0.7 %, 0.24 % rms (rounding to bf16: 0.17 %).
/// Below 2^-127 the weight is 0; from 2^129 on it is NaN.
struct Softmax {
  __m512 scale;                    // 256 · score_scale
  __m512i magic, error, order;     // order: keys of four even and four odd lanes into pairs
  const float* scores = nullptr;   // [2 lane tiles][32 keys][16]
  const float* offsets = nullptr;  // [2 lane tiles][16]
  uint32_t* weights = nullptr;     // [2 lane tiles][16 pairs][16]
  int next = 32, pairs = 32;

  explicit Softmax(float score_scale)
      : scale(_mm512_set1_ps(256 * score_scale)),
        magic(_mm512_set1_epi32(0x4B400000)),
        error(_mm512_load_si512(kLinearExcess)),
        order(_mm512_broadcast_i32x4(_mm_setr_epi8(0, 1, 8, 9, 2, 3, 10, 11, 4, 5, 12, 13, 6, 7, 14, 15))) {}

  PATINA_INLINE void pair() {
    const int n = next++;
    const __m512 offset = _mm512_load_ps(offsets + n / 16 * 16);
    const float* s = scores + n * 32;
    const __m512i even =
        _mm512_sub_epi32(_mm512_castps_si512(_mm512_fmadd_ps(_mm512_load_ps(s), scale, offset)), magic);
    const __m512i odd =
        _mm512_sub_epi32(_mm512_castps_si512(_mm512_fmadd_ps(_mm512_load_ps(s + 16), scale, offset)), magic);
    const __m512i x = _mm512_shuffle_epi8(_mm512_packus_epi32(even, odd), order);
    const __m512i too_much =
        _mm512_maskz_permutexvar_epi8(0x5555555555555555u, _mm512_srli_epi16(x, 2), error);
    _mm512_store_si512(weights + n * 16, _mm512_sub_epi16(_mm512_srli_epi16(x, 1), too_much));
  }
  template <int kPairs>
  PATINA_INLINE void some() {
    if (kPairs == 0 || next + kPairs > pairs) return;
#pragma GCC unroll 4
    for (int i = 0; i < kPairs; ++i) pair();
  }
  void rest() {
    while (next < pairs) pair();
  }
};

/// How many pairs go between two tile products of scores and of values, by the number of steps: as many as
/// the vector unit does meanwhile (measured).
template <int kSteps>
constexpr int kScorePairs = kSteps == 1   ? 4
                            : kSteps == 2 ? 3
                            : kSteps == 0 ? 0
                                          : 1;
template <int kSteps>
constexpr int kValuePairs = kSteps == 1                  ? 4
                            : kSteps == 0 || kSteps == 5 ? 0
                                                         : 1;

/// One job of scores -> s [2 lane tiles][32 keys][16]. Operands keep away from tiles that were just used:
/// AMX renames few. kSteps = 0: any number of steps.
template <int kSteps, class Between>
PATINA_INLINE void multiply_scores(int any_steps, const char* k, const char* q, float* s, Between&& between) {
  const int steps = kSteps == 0 ? any_steps : kSteps;
  const int64_t row = steps * kTileBytes;  // from one tile of keys or lanes to the next
  if constexpr (kSteps == 1 || kSteps == 2) {
    constexpr bool kTwo = kSteps == 2;
    _tile_loadd(4, k, 64);
    _tile_loadd(6, q, 64);
    _tile_zero(0);
    _tile_dpbf16ps(0, 4, 6);
    between();
    if constexpr (kTwo) {
      _tile_loadd(5, k + kTileBytes, 64);
      _tile_loadd(7, q + kTileBytes, 64);
      _tile_dpbf16ps(0, 5, 7);
      between();
    }
    _tile_stored(0, s, 64);
    _tile_loadd(2, q + row, 64);
    _tile_zero(1);
    _tile_dpbf16ps(1, 4, 2);
    between();
    if constexpr (kTwo) {
      _tile_loadd(3, q + row + kTileBytes, 64);
      _tile_dpbf16ps(1, 5, 3);
      between();
    }
    _tile_stored(1, s + 2 * kTileFloats, 64);
    _tile_loadd(4, k + row, 64);
    _tile_zero(0);
    _tile_dpbf16ps(0, 4, 2);
    between();
    if constexpr (kTwo) {
      _tile_loadd(5, k + row + kTileBytes, 64);
      _tile_dpbf16ps(0, 5, 3);
      between();
    }
    _tile_stored(0, s + 3 * kTileFloats, 64);
    _tile_zero(1);
    _tile_dpbf16ps(1, 4, 6);
    between();
    if constexpr (kTwo) {
      _tile_dpbf16ps(1, 5, 7);
      between();
    }
    _tile_stored(1, s + kTileFloats, 64);
  } else {
#pragma GCC unroll 1
    for (int half = 0; half < 2; ++half) {
      _tile_zero(0);
      _tile_zero(1);
      for (int i = 0; i < steps; ++i) {
        _tile_loadd(6, q + i * kTileBytes, 64);
        _tile_loadd(4, k + half * row + i * kTileBytes, 64);
        _tile_dpbf16ps(0, 4, 6);
        between();
        _tile_loadd(7, q + row + i * kTileBytes, 64);
        _tile_dpbf16ps(1, 4, 7);
        between();
      }
      _tile_stored(0, s + half * kTileFloats, 64);
      _tile_stored(1, s + (2 + half) * kTileFloats, 64);
    }
  }
}

/// out [rows][16][16] += values (tiles `group` bytes apart from one group of 32 keys to the next) times the
/// weights of one lane tile [kGroups][...].
template <class Between>
PATINA_INLINE void multiply_values(const char* v, int64_t group, const uint32_t* weights, int rows,
                                   float* out, Between&& between) {
  static_assert(kGroups == 4);
  _tile_loadd(4, weights, 64);
  _tile_loadd(5, weights + kJobWeights, 64);
  _tile_loadd(6, weights + 2 * kJobWeights, 64);
  _tile_loadd(7, weights + 3 * kJobWeights, 64);
#define PATINA_VALUE_ROW(sum)        \
  _tile_loadd(sum, out, 64);         \
  _tile_loadd(2, v, 64);             \
  _tile_dpbf16ps(sum, 2, 4);         \
  between();                         \
  _tile_loadd(3, v + group, 64);     \
  _tile_dpbf16ps(sum, 3, 5);         \
  between();                         \
  _tile_loadd(2, v + 2 * group, 64); \
  _tile_dpbf16ps(sum, 2, 6);         \
  between();                         \
  _tile_loadd(3, v + 3 * group, 64); \
  _tile_dpbf16ps(sum, 3, 7);         \
  between();                         \
  _tile_stored(sum, out, 64);        \
  v += kTileBytes;                   \
  out += kTileFloats;
  for (; rows >= 2; rows -= 2) {
    PATINA_VALUE_ROW(0)
    PATINA_VALUE_ROW(1)
  }
  if (rows > 0) {
    PATINA_VALUE_ROW(0)
  }
#undef PATINA_VALUE_ROW
}

/// Keys that do not exist score -inf, so that they weigh nothing.
void mask_tail(float* s, int64_t valid) {
  for (int key = static_cast<int>(valid < 0 ? 0 : valid); key < 32; ++key)
    for (int lanes = 0; lanes < 2; ++lanes)
      _mm512_store_ps(s + lanes * 2 * kTileFloats + key * 16, _mm512_set1_ps(-__builtin_inff()));
}

/// Sets m to the largest of the first scores, and the sums to zero.
template <int kSteps>
void start(const Block& block, const State& state) {
  const int steps = score_steps(block.head_dim);
  for (int64_t i = 0; i < int64_t{4} * value_tiles(block.head_dim) * kTileFloats; i += 16)
    _mm512_store_ps(state.out + i, _mm512_setzero_ps());
  for (int half = 0; half < 2; ++half) {
    float* s = block.scratch;
    multiply_scores<kSteps>(steps, static_cast<const char*>(block.k),
                            static_cast<const char*>(block.q) + half * 2 * steps * kTileBytes, s, [] {});
    mask_tail(s, block.num_keys);
    for (int lanes = 0; lanes < 2; ++lanes) {
      __m512 largest = _mm512_set1_ps(-3.4028234e38f);
      for (int key = 0; key < 32; ++key)
        largest = _mm512_max_ps(_mm512_load_ps(s + lanes * 2 * kTileFloats + key * 16), largest);
      const int at = (half * 2 + lanes) * 16;
      // m in 1/256 of log 2, rounded so that the offset is a whole number and adding it loses nothing.
      const __m512 m = _mm512_roundscale_ps(_mm512_mul_ps(largest, _mm512_set1_ps(256 * block.score_scale)),
                                            _MM_FROUND_TO_NEAREST_INT);
      _mm512_store_ps(state.largest + at, _mm512_mul_ps(m, _mm512_set1_ps(1.0f / 256)));
      _mm512_store_ps(state.offsets + at, _mm512_sub_ps(_mm512_set1_ps(12582912.0f + 127 * 256), m));
    }
  }
}

/// The pipeline over a panel. Slot t multiplies the scores of job t, turns those of job t - 1 into weights
/// between the products, and multiplies a quarter of the values of the phase before that.
template <int kSteps>
void attend_panel(const Block& block, const State& state) {
  const int steps = score_steps(block.head_dim), rows = value_tiles(block.head_dim);
  const int halves = block.num_lanes > 32 ? 2 : 1;
  const int64_t panel_keys = block.end_key - block.begin_key;
  const int64_t phases = (panel_keys + kPhaseKeys - 1) / kPhaseKeys * halves, jobs = phases * kGroups;
  const float beta = block.beta / block.score_scale;  // in units of the products
  const int64_t value_group = rows * kTileBytes;
  float* scores = block.scratch;                                                    // two jobs
  uint32_t* weights = reinterpret_cast<uint32_t*>(block.scratch + 2 * kJobFloats);  // two phases
  const BiasedKey* biased[2] = {block.biased, block.biased};                        // of each half

  Softmax softmax(block.score_scale);
  const auto key_of_job = [&](int64_t job) {
    return block.begin_key + job / kGroups / halves * kPhaseKeys + job % kGroups * 32;
  };
  for (int64_t slot = 0; slot <= jobs + kGroups; ++slot) {
    if (const int64_t job = slot - 1; job >= 0 && job < jobs) {
      const int64_t key0 = key_of_job(job);
      const int half = static_cast<int>(job / kGroups % halves);
      float* s = scores + job % 2 * kJobFloats;
      for (const BiasedKey*& b = biased[half]; b->key < key0 + 32; ++b) {
        if (b->key < key0) continue;  // before this panel
        float* row = s + (b->key - key0) * 16;
        add_in_lanes(row, Vec16::set1(beta), b->lanes >> (half * 32));
        add_in_lanes(row + 2 * kTileFloats, Vec16::set1(beta), b->lanes >> (half * 32 + 16));
      }
      if (block.num_keys < key0 + 32) mask_tail(s, block.num_keys - key0);
      softmax.scores = s;
      softmax.offsets = state.offsets + half * 32;
      softmax.weights = weights + (job / kGroups % 2 * kGroups + job % kGroups) * kJobWeights;
      softmax.next = 0;
    }
    if (slot < jobs) {
      const int64_t key_tile = key_of_job(slot) / 16, lane_tile = slot / kGroups % halves * 2;
      multiply_scores<kSteps>(
          steps, static_cast<const char*>(block.k) + key_tile * steps * kTileBytes,
          static_cast<const char*>(block.q) + lane_tile * steps * kTileBytes,
          scores + slot % 2 * kJobFloats, [&]() __attribute__((always_inline)) {
            softmax.some<kScorePairs<kSteps>>();
          });
    }
    if (const int64_t quarter = slot - 1 - kGroups; quarter >= 0 && quarter < jobs) {
      const int64_t phase = quarter / kGroups;
      const int lanes = static_cast<int>(quarter % kGroups / 2), first = quarter % 2 ? (rows + 1) / 2 : 0;
      const char* v = static_cast<const char*>(block.v) + key_of_job(phase * kGroups) / 32 * value_group;
      multiply_values(
          v + first * kTileBytes, value_group,
          weights + phase % 2 * kGroups * kJobWeights + lanes * kTileFloats,
          quarter % 2 ? rows / 2 : (rows + 1) / 2,
          state.out + ((phase % halves * 2 + lanes) * rows + first) * kTileFloats,
          [&]() __attribute__((always_inline)) { softmax.some<kValuePairs<kSteps>>(); });
    }
    softmax.rest();
  }
}

/// Divides by the sums -> out, log_sum_exp; returns the lanes whose weights left the range.
uint64_t finish(const Block& block, const State& state) {
  const int rows = value_tiles(block.head_dim);
  const __m512 lowest = _mm512_set1_ps(0x1p-60f), highest = _mm512_set1_ps(0x1p100f);
  uint64_t failed = 0;
  for (int c = 0; c < (block.num_lanes + 15) / 16; ++c) {
    const float* o = state.out + c * rows * kTileFloats;
    const __m512 sum = _mm512_load_ps(o + block.head_dim * 16);
    const __m512 largest = _mm512_load_ps(state.largest + c * 16);
    // Up to this |m| offsets are exact.
    const __mmask16 in_range =
        _mm512_cmp_ps_mask(sum, lowest, _CMP_GE_OQ) & _mm512_cmp_ps_mask(sum, highest, _CMP_LE_OQ) &
        _mm512_cmp_ps_mask(_mm512_abs_ps(largest), _mm512_set1_ps(0x1p13f), _CMP_LE_OQ);
    failed |= static_cast<uint64_t>(static_cast<uint16_t>(~in_range)) << (c * 16);
    const __m512 inverse = _mm512_div_ps(_mm512_set1_ps(1.0f), sum);
    for (int row = 0; row < block.head_dim; ++row)
      _mm512_store_ps(block.out + row * kLanes + c * 16,
                      _mm512_mul_ps(_mm512_load_ps(o + row * 16), inverse));
    for (int lane = 0; lane < 16; ++lane)
      block.log_sum_exp[c * 16 + lane] =
          (state.largest[c * 16 + lane] + __builtin_log2f(o[block.head_dim * 16 + lane])) * 0.693147181f;
  }
  const uint64_t used = block.num_lanes < 64 ? (uint64_t{1} << block.num_lanes) - 1 : ~uint64_t{0};
  return failed & used;
}

/// Replaces the given lanes by what the online kernel makes of the whole row, so that no row's result depends
/// on its neighbours.
void redo(const Block& block, const State& state, uint64_t lanes) {
  float* kept = state.out;  // [head_dim][64]: the sums are not needed any more
  for (int64_t i = 0; i < int64_t{block.head_dim} * kLanes; i += 16)
    _mm512_store_ps(kept + i, _mm512_load_ps(block.out + i));
  alignas(64) float kept_sums[kLanes];
  for (int i = 0; i < kLanes; ++i) kept_sums[i] = block.log_sum_exp[i];
  attend_bf16<TileProducts>(block);
  for (int row = 0; row < block.head_dim; ++row)
    for (int c = 0; c < kLanes; c += 16) {
      float* out = block.out + row * kLanes + c;
      _mm512_mask_store_ps(out, static_cast<__mmask16>(~(lanes >> c)),
                           _mm512_load_ps(kept + row * kLanes + c));
    }
  for (int i = 0; i < kLanes; ++i)
    if (!(lanes >> i & 1)) block.log_sum_exp[i] = kept_sums[i];
}

template <int kSteps>
void attend_steps(const Block& block) {
  const State state(block.state);
  if (block.begin_key == 0) start<kSteps>(block, state);
  attend_panel<kSteps>(block, state);
}

void attend(const Block& block) {
  _tile_loadconfig(&kTileConfig);
  switch (score_steps(block.head_dim)) {
    case 1:
      attend_steps<1>(block);
      break;
    case 2:
      attend_steps<2>(block);
      break;
    case 3:
      attend_steps<3>(block);
      break;
    case 4:
      attend_steps<4>(block);
      break;
    case 5:
      attend_steps<5>(block);
      break;
    default:
      attend_steps<0>(block);
  }
  if (block.end_key == block.num_keys) {
    const State state(block.state);
    const uint64_t failed = finish(block, state) | block.immoderate_lanes;
    if (failed) redo(block, state, failed);
  }
  _tile_release();
}

}  // namespace

Kernel amx_bf16_kernel() {
  return {Packing::kBf16Tiles, true, state_floats, attend};
}

}  // namespace patina::attention
