// The part of the page that shows the pictures that the edit was to be like.
#pragma once

#include <span>
#include <string>

#include "patina/image/image.h"

namespace patina::report {

struct ExemplarPicture {
  std::string caption;  // file, weight and materials
  Image picture;        // [H,W,3] sRGB as the model saw it
};

/// A <section>; empty without pictures.
std::string exemplars(std::span<const ExemplarPicture> pictures);

}  // namespace patina::report
