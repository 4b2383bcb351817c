// The f32 kernel on AVX2 and FMA: eight lanes, sixteen registers.
#include <immintrin.h>

#include <cstdint>

#include "patina/attention/cpu/kernel.h"

namespace patina::attention {
namespace {

struct Vec8 {
  static constexpr int kWidth = 8, kColumns = 2, kRows = 6, kTileKeys = 96;  // 12 of 16 registers accumulate
  __m256 v;

  static Vec8 zero() { return {_mm256_setzero_ps()}; }
  static Vec8 set1(float x) { return {_mm256_set1_ps(x)}; }
  static Vec8 load(const float* p) { return {_mm256_load_ps(p)}; }
  void store(float* p) const { _mm256_store_ps(p, v); }
};
inline Vec8 operator+(Vec8 a, Vec8 b) {
  return {_mm256_add_ps(a.v, b.v)};
}
inline Vec8 operator-(Vec8 a, Vec8 b) {
  return {_mm256_sub_ps(a.v, b.v)};
}
inline Vec8 operator*(Vec8 a, Vec8 b) {
  return {_mm256_mul_ps(a.v, b.v)};
}
inline Vec8 operator/(Vec8 a, Vec8 b) {
  return {_mm256_div_ps(a.v, b.v)};
}
inline Vec8 fma(Vec8 a, Vec8 b, Vec8 c) {
  return {_mm256_fmadd_ps(a.v, b.v, c.v)};
}
/// The larger one; b where either is NaN.
inline Vec8 max_keeping_nan(Vec8 a, Vec8 b) {
  return {_mm256_max_ps(a.v, b.v)};
}
/// The float whose exponent is the lowest eight bits of x and whose other bits are zero.
inline Vec8 from_lowest_bits(Vec8 x) {
  return {_mm256_castsi256_ps(_mm256_slli_epi32(_mm256_castps_si256(x.v), 23))};
}
inline void add_in_lanes(float* row, Vec8 value, uint64_t lanes) {
  const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  const __m256i set = _mm256_and_si256(_mm256_set1_epi32(static_cast<int>(lanes & 0xff)), bit);
  const __m256 mask = _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, bit));
  const __m256 old = _mm256_load_ps(row);
  _mm256_store_ps(row, _mm256_blendv_ps(old, _mm256_add_ps(old, value.v), mask));
}

// Each stands on those above it.
#include "patina/attention/cpu/exp2.inl"
#include "patina/attention/cpu/rows.inl"

#include "patina/attention/cpu/flash_f32.inl"

}  // namespace

Kernel avx2_kernel() {
  return {Packing::kF32, false, nullptr, attend<Vec8>};
}

}  // namespace patina::attention
