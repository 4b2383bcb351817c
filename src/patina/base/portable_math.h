// Functions of <cmath> that give the same bits with every C library. glibc 2.41 rounds its float versions
// otherwise than earlier ones, and one last bit is enough to change a fitted texture. Rounded from double,
// whose error is some 10⁻⁹ of a float's last bit, all agree but for one argument in a hundred million.
#pragma once

#include <cmath>

namespace patina::portable {

inline float cbrt(float x) {
  return static_cast<float>(std::cbrt(static_cast<double>(x)));
}
inline float atan2(float y, float x) {
  return static_cast<float>(std::atan2(static_cast<double>(y), static_cast<double>(x)));
}
inline float tan(float radians) {
  return static_cast<float>(std::tan(static_cast<double>(radians)));
}

}  // namespace patina::portable
