// Image-space helpers of baking: a joint bilateral filter, and values continued past an object's silhouette.
#pragma once

#include <cstdint>
#include <vector>

#include "patina/base/math.h"

namespace patina::make_dataset {

/// What tells the filter which neighbours lie on the same piece of surface.
struct SmoothingGuide {
  int width = 0, height = 0;
  std::vector<uint8_t> valid;
  std::vector<vec3> position, normal;
};

/// Replaces each plane by its mean over (2 radius + 1)² pixels, weighed by distance, bend and height above
/// the tangent plane [Eisemann2004]. Pixels that are not valid stay as they are and count nowhere.
void smooth(const SmoothingGuide& guide, const std::vector<std::vector<float>*>& planes, int radius);

/// Gives pixels that are not valid the values of valid ones nearby, smoothly: averages of ever larger squares
/// [Gortler1996, Sec. 3.4]. A picture without valid pixels becomes zero.
void fill_around(int width, int height, const std::vector<uint8_t>& valid, std::vector<float>& plane);

}  // namespace patina::make_dataset
