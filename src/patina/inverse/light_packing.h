// Eight bytes for one incident direction and the light it carries: an octahedral direction of 2 × 16 bits
// [Cigolle2014] and RGB with a shared exponent [Ward1991].
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "patina/base/math.h"

namespace patina::inverse {

/// Unit vector → two 16-bit coordinates on the unfolded octahedron; the angle is kept to 6e-5 rad.
inline uint32_t pack_direction(const vec3& d) {
  const float inverse_norm = 1.0f / (std::abs(d.x) + std::abs(d.y) + std::abs(d.z));
  vec2 p = vec2(d.x, d.y) * inverse_norm;
  if (d.z < 0.0f)
    p = vec2(std::copysign(1.0f - std::abs(p.y), p.x), std::copysign(1.0f - std::abs(p.x), p.y));
  const auto quantised = [](float v) {
    return static_cast<uint32_t>(std::clamp(v, -1.0f, 1.0f) * 32767.0f + 32767.5f);
  };
  return quantised(p.x) | quantised(p.y) << 16;
}

inline vec3 unpack_direction(uint32_t packed) {
  const vec2 p = vec2(static_cast<float>(static_cast<int>(packed & 0xFFFFu) - 32767),
                      static_cast<float>(static_cast<int>(packed >> 16) - 32767)) *
                 (1.0f / 32767.0f);
  vec3 d(p, 1.0f - std::abs(p.x) - std::abs(p.y));
  const float fold = std::max(-d.z, 0.0f);
  d.x -= std::copysign(fold, d.x);
  d.y -= std::copysign(fold, d.y);
  return d / std::sqrt(glm::dot(d, d));
}

/// Three non-negative floats share one 8-bit exponent; 8-bit mantissas keep each to 0.4 % of the largest.
/// Monte Carlo weights span more than the 5-bit exponents of common GPU formats. Negative and not-a-number
/// become zero.
inline uint32_t pack_radiance(const vec3& rgb) {
  const float largest = std::max(rgb.x, std::max(rgb.y, rgb.z));
  if (!(largest > 1e-30f)) return 0;  // also NaN
  int exponent = 0;
  std::frexp(std::min(largest, 1e30f), &exponent);
  float scale = std::ldexp(1.0f, 8 - exponent);
  if (std::min(largest, 1e30f) * scale + 0.5f >= 256.0f) scale = std::ldexp(1.0f, 8 - ++exponent);
  const auto mantissa = [&](float v) {
    return static_cast<uint32_t>(std::clamp(std::min(v, 1e30f) * scale + 0.5f, 0.0f, 255.0f));
  };
  return mantissa(rgb.x) | mantissa(rgb.y) << 8 | mantissa(rgb.z) << 16 |
         static_cast<uint32_t>(exponent + 127) << 24;
}

inline vec3 unpack_radiance(uint32_t packed) {
  // value = mantissa · 2^(exponent − 8); the factor's bits are built directly. The exponent of a packed value
  // lies above −100.
  if (packed == 0) return vec3(0.0f);
  const float scale = std::bit_cast<float>(((packed >> 24) - 8u) << 23);
  return vec3(static_cast<float>(packed & 0xFFu), static_cast<float>(packed >> 8 & 0xFFu),
              static_cast<float>(packed >> 16 & 0xFFu)) *
         scale;
}

}  // namespace patina::inverse
