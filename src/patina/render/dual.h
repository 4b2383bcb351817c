// Dual numbers: a value with its derivatives in N directions, carried forward through ordinary arithmetic.
// Code written over a scalar type T computes values with T = float and exact derivatives with T = Dual<N>
// [Griewank2008, Ch. 3].
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>

namespace patina::render {

template <size_t N>
struct Dual {
  float v = 0.0f;            // value
  std::array<float, N> d{};  // derivatives

  Dual() = default;
  Dual(float value) : v(value) {}  // NOLINT: a constant is a dual number with no derivative
  Dual(float value, size_t slot) : v(value) { d[slot] = 1.0f; }
};

/// f(a) with f'(a) = slope, by the chain rule.
template <size_t N>
inline Dual<N> chain(const Dual<N>& a, float value, float slope) {
  Dual<N> out(value);
  for (size_t i = 0; i < N; ++i) out.d[i] = slope * a.d[i];
  return out;
}

template <size_t N>
inline Dual<N> operator-(const Dual<N>& a) {
  return chain(a, -a.v, -1.0f);
}
template <size_t N>
inline Dual<N> operator+(const Dual<N>& a, const Dual<N>& b) {
  Dual<N> out(a.v + b.v);
  for (size_t i = 0; i < N; ++i) out.d[i] = a.d[i] + b.d[i];
  return out;
}
template <size_t N>
inline Dual<N> operator-(const Dual<N>& a, const Dual<N>& b) {
  Dual<N> out(a.v - b.v);
  for (size_t i = 0; i < N; ++i) out.d[i] = a.d[i] - b.d[i];
  return out;
}
template <size_t N>
inline Dual<N> operator*(const Dual<N>& a, const Dual<N>& b) {
  Dual<N> out(a.v * b.v);
  for (size_t i = 0; i < N; ++i) out.d[i] = a.d[i] * b.v + a.v * b.d[i];
  return out;
}
template <size_t N>
inline Dual<N> operator/(const Dual<N>& a, const Dual<N>& b) {
  const float inverse = 1.0f / b.v;
  Dual<N> out(a.v * inverse);
  for (size_t i = 0; i < N; ++i) out.d[i] = (a.d[i] - out.v * b.d[i]) * inverse;
  return out;
}

// Mixed with constants: fewer operations than lifting the constant to a dual number.
template <size_t N>
inline Dual<N> operator+(const Dual<N>& a, float b) {
  Dual<N> out = a;
  out.v += b;
  return out;
}
template <size_t N>
inline Dual<N> operator+(float a, const Dual<N>& b) {
  return b + a;
}
template <size_t N>
inline Dual<N> operator-(const Dual<N>& a, float b) {
  return a + (-b);
}
template <size_t N>
inline Dual<N> operator-(float a, const Dual<N>& b) {
  return chain(b, a - b.v, -1.0f);
}
template <size_t N>
inline Dual<N> operator*(const Dual<N>& a, float b) {
  return chain(a, a.v * b, b);
}
template <size_t N>
inline Dual<N> operator*(float a, const Dual<N>& b) {
  return b * a;
}
template <size_t N>
inline Dual<N> operator/(const Dual<N>& a, float b) {
  return a * (1.0f / b);
}
template <size_t N>
inline Dual<N> operator/(float a, const Dual<N>& b) {
  const float value = a / b.v;
  return chain(b, value, -value / b.v);
}

/// The derivative at zero is taken as zero, not infinite.
template <size_t N>
inline Dual<N> sqrt(const Dual<N>& a) {
  const float root = std::sqrt(a.v);
  return chain(a, root, root > 0.0f ? 0.5f / root : 0.0f);
}
/// max(a, bound); the derivative is zero where the bound holds.
template <size_t N>
inline Dual<N> at_least(const Dual<N>& a, float bound) {
  return a.v > bound ? a : Dual<N>(bound);
}
inline float at_least(float a, float bound) {
  return a > bound ? a : bound;
}

}  // namespace patina::render
