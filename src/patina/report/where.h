// The part of the page that shows the masks: on the textures, and as the views see them.
#pragma once

#include <span>
#include <string>

#include "patina/image/image.h"

namespace patina::report {

/// How strongly a material's texels may change.
struct MaskPicture {
  std::string material;
  Image strength;  // [h,w,1] in [0,1]
};

/// A <section> with both; `views` are [H,W,1] in [0,1], one a view, below 0 where nothing of the asset is.
/// Empty without pictures.
std::string where(std::span<const MaskPicture> masks, std::span<const Image> views);

}  // namespace patina::report
