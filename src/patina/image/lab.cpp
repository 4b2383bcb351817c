#include "patina/image/lab.h"

#include "patina/base/portable_math.h"

namespace patina {

vec3 lab_from_linear(const vec3& rgb) {
  const float x = (0.4124f * rgb.x + 0.3576f * rgb.y + 0.1805f * rgb.z) / 0.9505f;
  const float y = 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;
  const float z = (0.0193f * rgb.x + 0.1192f * rgb.y + 0.9505f * rgb.z) / 1.089f;
  const auto f = [](float t) { return t > 0.008856f ? portable::cbrt(t) : 7.787f * t + 16.0f / 116.0f; };
  return {116.0f * f(y) - 16.0f, 500.0f * (f(x) - f(y)), 200.0f * (f(y) - f(z))};
}

}  // namespace patina
