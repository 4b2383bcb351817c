// The part of the page that shows which words act on which part of the asset.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "patina/image/image.h"

namespace patina::report {

/// Materials with words of their own.
struct PartWords {
  std::vector<std::string> materials;
  std::string prompt, negative_prompt;
  std::string color;  // "#rrggbb" of the part in the views
};

/// A <section> with both; `views` are [H,W,3] sRGB, one a view. Empty without parts.
std::string parts(std::span<const PartWords> parts, std::span<const Image> views);

}  // namespace patina::report
