// bfloat16 as its upper sixteen bits of an f32; conversion rounds to nearest even.
#pragma once

#include <bit>
#include <cstdint>

namespace patina {

inline float float_of_bf16(uint16_t bits) {
  return std::bit_cast<float>(static_cast<uint32_t>(bits) << 16);
}

inline uint16_t bf16_of_float(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  if ((bits & 0x7fffffffu) > 0x7f800000u)
    return static_cast<uint16_t>((bits >> 16) | 0x40u);  // NaN stays NaN
  return static_cast<uint16_t>((bits + 0x7fffu + ((bits >> 16) & 1u)) >> 16);
}

/// Whether this processor multiplies bf16 in one instruction. Where it does not, libraries emulate bf16, many
/// times slower than f32.
inline bool multiplies_bf16() {
  return __builtin_cpu_supports("avx512bf16");
}

}  // namespace patina
