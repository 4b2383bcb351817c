// Counter-based random numbers: a value depends on (seed, purpose, index) alone, never on threads or order.
// Source: Philox4x32-10 [Salmon2011].
#pragma once

#include <array>
#include <cstdint>

#include "patina/base/math.h"

namespace patina {

/// What a stream of numbers is for; two purposes never share numbers.
enum class RandomPurpose : uint32_t {
  kPathTracing = 1,
  kNoiseField = 2,
  kIndependentNoise = 3,
  kSchedulerNoise = 4,
  kLightCache = 5,
  kGBuffer = 7,
  kMasks = 8,
  kMaterialKinds = 9,
  kTest = 100,
};

/// Ten rounds of Philox4x32: 128 counter bits and 64 key bits in, 128 random bits out.
std::array<uint32_t, 4> philox(std::array<uint32_t, 4> counter, std::array<uint32_t, 2> key);

/// A number in [0,1), from the upper 24 bits.
inline float uniform_from_bits(uint32_t bits) {
  return static_cast<float>(bits >> 8) * 0x1p-24f;
}

/// Four independent standard normal numbers from 128 random bits (Box-Muller; |value| <= 5.8).
std::array<float, 4> gaussian_from_bits(const std::array<uint32_t, 4>& bits);

/// Four standard normal numbers for a 64-bit index and a 32-bit sub-index of (seed, purpose).
std::array<float, 4> gaussian4(uint64_t seed, RandomPurpose purpose, uint64_t index, uint32_t sub_index = 0);

/// A sequence of uniform numbers that belongs to one index (a pixel sample, a texel), cheap to make.
class RandomStream {
 public:
  RandomStream(uint64_t seed, RandomPurpose purpose, uint64_t index, uint32_t sub_index = 0);
  /// The stream of sample 0, 1, 2, … of `index`. Together they are spread evenly: the k-th draw of 2ⁿ samples
  /// has one in each of 2ⁿ equal intervals, of a uniform2() also in each of 2ⁿ equal boxes of any shape.
  /// Sobol's first two dimensions, order and digits scrambled anew for every draw [Burley2020].
  static RandomStream even(uint64_t seed, RandomPurpose purpose, uint64_t index, uint32_t sample);

  float uniform();  ///< in [0,1)
  vec2 uniform2();
  float gaussian();  ///< standard normal

 private:
  std::array<uint32_t, 4> next_block();
  std::array<uint32_t, 2> next_even();

  std::array<uint32_t, 2> key_;
  std::array<uint32_t, 4> counter_;
  std::array<uint32_t, 4> block_{};
  int used_ = 4;
  bool is_even_ = false;
  uint32_t reversed_sample_ = 0;  // of an even stream; its digits from the last to the first
  uint32_t draw_ = 0;
};

}  // namespace patina
