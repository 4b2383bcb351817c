// Random draws for the data tools: small helpers over the library's counter-based numbers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "patina/base/random.h"

namespace patina::mini_data {

/// Purposes of the tools' numbers, apart from the library's.
inline constexpr RandomPurpose kDrawShape{201}, kDrawView{202}, kDrawLight{203}, kDrawPlan{204};

class Draw {
 public:
  Draw(uint64_t seed, RandomPurpose purpose, uint64_t index = 0) : stream_(seed, purpose, index) {}

  float operator()(float low, float high) { return low + (high - low) * stream_.uniform(); }
  bool chance(float probability) { return stream_.uniform() < probability; }
  /// In [0, count).
  int below(int count) {
    return std::min(static_cast<int>(stream_.uniform() * static_cast<float>(count)), count - 1);
  }
  template <class T>
  const T& of(const std::vector<T>& choices) {
    return choices[static_cast<size_t>(below(static_cast<int>(choices.size())))];
  }
  float gaussian() { return stream_.gaussian(); }

 private:
  RandomStream stream_;
};

}  // namespace patina::mini_data
