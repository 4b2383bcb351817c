// How much the colour of each material differs between two pictures of the same views.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "patina/image/image.h"

namespace patina::report {

/// One view in two pictures.
struct PicturePair {
  const Image* a;                     // [H,W,3] sRGB
  const Image* b;                     // [H,W,3] sRGB
  std::span<const int32_t> material;  // [H,W], negative or out of range: no material
  const Image* weight;                // [H,W,1] in [0,1]; pixels below ½ do not count
};

/// For each material the distance ΔE*ab between its mean colours in a and b [CIE15], averaged over the views
/// by the number of its pixels; 2.3 is about what the eye just tells apart. Noise and fine detail, which
/// differ pixel by pixel, cancel. NaN for a material that no view shows.
std::vector<double> material_color_differences(std::span<const PicturePair> views, size_t num_materials);

}  // namespace patina::report
