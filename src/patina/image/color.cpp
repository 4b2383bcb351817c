#include "patina/image/color.h"

#include <cmath>

#include "patina/base/check.h"

namespace patina {
namespace {

template <class Function>
Image map_pixels(const Image& image, Function function) {
  Image out = image;
  for (float& value : out.pixels) value = function(value);
  return out;
}

}  // namespace

float srgb_from_linear(float linear) {
  const float a = std::abs(linear);
  const float s = a <= 0.0031308f ? 12.92f * a : 1.055f * std::pow(a, 1.0f / 2.4f) - 0.055f;
  return std::copysign(s, linear);
}

float linear_from_srgb(float srgb) {
  const float a = std::abs(srgb);
  const float l = a <= 0.04045f ? a / 12.92f : std::pow((a + 0.055f) / 1.055f, 2.4f);
  return std::copysign(l, srgb);
}

Image srgb_from_linear(const Image& linear) {
  return map_pixels(linear, [](float v) { return srgb_from_linear(v); });
}

Image linear_from_srgb(const Image& srgb) {
  return map_pixels(srgb, [](float v) { return linear_from_srgb(v); });
}

Image tone_map(const Image& radiance, float exposure_ev) {
  PATINA_CHECK_EQ(radiance.channels, 3);
  const float gain = std::exp2(exposure_ev);
  return map_pixels(radiance, [&](float v) { return srgb_from_linear(reinhard(gain * v)); });
}

}  // namespace patina
