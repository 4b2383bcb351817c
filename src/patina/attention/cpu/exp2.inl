// The softmax's exponential, for any vector type; included by each kernel unit inside its anonymous
// namespace.

constexpr int kLanes = kBlockQueries;

/// 2^x for x <= 0, relative error 1e-7; 0 below -126.5, NaN for NaN. Minimax on [-1/2, 1/2] of degree 6.
template <class V>
inline __attribute__((always_inline)) V exp2_nonpositive(V x) {
  x = max_keeping_nan(V::set1(-127.0f), x);
  const V n = round_to_int(x);
  const V r = x - n;
  V p = V::set1(1.53458122e-4f);
  p = fma(p, r, V::set1(1.33999312e-3f));
  p = fma(p, r, V::set1(9.61848896e-3f));
  p = fma(p, r, V::set1(5.55032878e-2f));
  p = fma(p, r, V::set1(2.40226469e-1f));
  p = fma(p, r, V::set1(6.93147206e-1f));
  p = fma(p, r, V::set1(1.0f));
  return p * power_of_two(n);
}
