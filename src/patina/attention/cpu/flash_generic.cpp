// The f32 kernel in portable C++: 128-bit vectors of the compiler, whatever the machine.
#include <cstdint>

#include "patina/attention/cpu/kernel.h"

namespace patina::attention {
namespace {

using Floats = float __attribute__((vector_size(16)));
using Ints = int32_t __attribute__((vector_size(16)));

struct Vec4 {
  static constexpr int kWidth = 4, kColumns = 2, kRows = 6, kTileKeys = 96;  // 12 of 16 registers accumulate
  Floats v;

  static Vec4 zero() { return {Floats{}}; }
  static Vec4 set1(float x) { return {Floats{x, x, x, x}}; }
  static Vec4 load(const float* p) { return {*reinterpret_cast<const Floats*>(p)}; }
  void store(float* p) const { *reinterpret_cast<Floats*>(p) = v; }
};
inline Vec4 operator+(Vec4 a, Vec4 b) {
  return {a.v + b.v};
}
inline Vec4 operator-(Vec4 a, Vec4 b) {
  return {a.v - b.v};
}
inline Vec4 operator*(Vec4 a, Vec4 b) {
  return {a.v * b.v};
}
inline Vec4 operator/(Vec4 a, Vec4 b) {
  return {a.v / b.v};
}
inline Vec4 fma(Vec4 a, Vec4 b, Vec4 c) {
  return {a.v * b.v + c.v};
}
/// The larger one; b where either is NaN.
inline Vec4 max_keeping_nan(Vec4 a, Vec4 b) {
  return {a.v > b.v ? a.v : b.v};
}
/// The float whose exponent is the lowest eight bits of x and whose other bits are zero.
inline Vec4 from_lowest_bits(Vec4 x) {
  return {reinterpret_cast<Floats>(reinterpret_cast<Ints>(x.v) << 23)};
}
inline void add_in_lanes(float* row, Vec4 value, uint64_t lanes) {
  for (int i = 0; i < 4; ++i)
    if (lanes >> i & 1) row[i] += value.v[i];
}

// Each stands on those above it.
#include "patina/attention/cpu/exp2.inl"
#include "patina/attention/cpu/rows.inl"

#include "patina/attention/cpu/flash_f32.inl"

}  // namespace

Kernel generic_kernel() {
  return {Packing::kF32, false, nullptr, attend<Vec4>};
}

}  // namespace patina::attention
