// Sixteen f32 lanes of AVX-512; included by each AVX-512 unit inside its anonymous namespace.

struct Vec16 {
  static constexpr int kWidth = 16, kColumns = 4, kRows = 6, kTileKeys = 96;  // 24 of 32 registers accumulate
  __m512 v;

  static Vec16 zero() { return {_mm512_setzero_ps()}; }
  static Vec16 set1(float x) { return {_mm512_set1_ps(x)}; }
  static Vec16 load(const float* p) { return {_mm512_load_ps(p)}; }
  void store(float* p) const { _mm512_store_ps(p, v); }
};
inline Vec16 operator+(Vec16 a, Vec16 b) {
  return {_mm512_add_ps(a.v, b.v)};
}
inline Vec16 operator-(Vec16 a, Vec16 b) {
  return {_mm512_sub_ps(a.v, b.v)};
}
inline Vec16 operator*(Vec16 a, Vec16 b) {
  return {_mm512_mul_ps(a.v, b.v)};
}
inline Vec16 operator/(Vec16 a, Vec16 b) {
  return {_mm512_div_ps(a.v, b.v)};
}
inline Vec16 fma(Vec16 a, Vec16 b, Vec16 c) {
  return {_mm512_fmadd_ps(a.v, b.v, c.v)};
}
/// The larger one; b where either is NaN.
inline Vec16 max_keeping_nan(Vec16 a, Vec16 b) {
  return {_mm512_max_ps(a.v, b.v)};
}
/// The float whose exponent is the lowest eight bits of x and whose other bits are zero.
inline Vec16 from_lowest_bits(Vec16 x) {
  return {_mm512_castsi512_ps(_mm512_slli_epi32(_mm512_castps_si512(x.v), 23))};
}
inline void add_in_lanes(float* row, Vec16 value, uint64_t lanes) {
  const __m512 old = _mm512_load_ps(row);
  _mm512_store_ps(row, _mm512_mask_add_ps(old, static_cast<__mmask16>(lanes), old, value.v));
}
