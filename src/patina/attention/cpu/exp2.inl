// The softmax's exponential, for any vector type; included by each kernel unit inside its anonymous
// namespace.

constexpr int kLanes = kBlockQueries;

/// 2^x for x <= 0; 0 below -126.5, NaN for NaN, 1 for 0. Minimax polynomial of degree 5 on [-1/2, 1/2], made
/// for relative error with its constant then rounded to 1: at most 1.5e-7 before f32 rounding.
template <class V>
inline __attribute__((always_inline)) V exp2_nonpositive(V x) {
  x = max_keeping_nan(V::set1(-127.0f), x);
  // Adding 1.5 · 2²³ + 127 rounds to an integer n and leaves n + 127, the biased exponent of 2^n, in the
  // lowest bits.
  const V shift = V::set1(12583039.0f);
  const V shifted = x + shift;
  const V r = x - (shifted - shift);
  V p = fma(V::set1(1.32764722e-3f), r, V::set1(9.67554133e-3f));
  p = fma(p, r, V::set1(5.55071327e-2f));
  p = fma(p, r, V::set1(2.40221197e-1f));
  p = fma(p, r, V::set1(6.93146967e-1f));
  p = fma(p, r, V::set1(1.0f));
  return p * from_lowest_bits(shifted);
}
