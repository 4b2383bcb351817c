// Pictures that the tests of the report share.
#pragma once

#include "patina/base/random.h"
#include "patina/image/image.h"

namespace patina::test {

/// Uniform noise in [0,1) in every channel.
inline Image noise_picture(int width, int height, uint64_t seed) {
  Image image(width, height, 3);
  RandomStream random(seed, RandomPurpose::kTest, 0);
  for (float& value : image.pixels) value = random.uniform();
  return image;
}

/// Smooth coloured waves; `phase` shifts them, `wavelength` is in pixels.
inline Image wave_picture(int width, int height, float phase, float wavelength = 32) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const float u = 2 * kPi * static_cast<float>(x) / wavelength,
                  v = 2 * kPi * static_cast<float>(y) / wavelength;
      image.set_rgb(x, y,
                    {0.5f + 0.4f * std::sin(u + phase), 0.5f + 0.4f * std::sin(v - phase),
                     0.5f + 0.3f * std::sin(u + v)});
    }
  return image;
}

}  // namespace patina::test
