// An image in memory: float pixels, rows from the top, channels interleaved.
#pragma once

#include <cstddef>
#include <vector>

#include "patina/base/math.h"

namespace patina {

/// pixels [height, width, channels] f32. Colour space and range are stated where an image is made; pixel (x,
/// y) covers [x, x+1) × [y, y+1), its centre lies at +0.5, the origin is top left.
struct Image {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<float> pixels;

  Image() = default;
  Image(int width_, int height_, int channels_, float value = 0.0f)
      : width(width_),
        height(height_),
        channels(channels_),
        pixels(static_cast<size_t>(width_) * static_cast<size_t>(height_) * static_cast<size_t>(channels_),
               value) {}

  bool empty() const { return pixels.empty(); }
  size_t num_pixels() const { return static_cast<size_t>(width) * static_cast<size_t>(height); }
  size_t offset(int x, int y) const {
    return (static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)) *
           static_cast<size_t>(channels);
  }
  float* at(int x, int y) { return pixels.data() + offset(x, y); }
  const float* at(int x, int y) const { return pixels.data() + offset(x, y); }
  vec3 rgb(int x, int y) const {
    const float* p = at(x, y);
    return {p[0], p[1], p[2]};
  }
  void set_rgb(int x, int y, const vec3& value) {
    float* p = at(x, y);
    p[0] = value.x, p[1] = value.y, p[2] = value.z;
  }
};

}  // namespace patina
