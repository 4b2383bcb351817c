// The part of the page that shows the result in light that it was not fitted in.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/image/image.h"

namespace patina::report {

/// The same cameras before and after in one light, sRGB.
struct RelitPictures {
  std::string light;  // for people: "overcast sky"
  std::vector<Image> before, after;
};

/// A <section> with the pictures and, folded, the table of metrics["relight"] (pipeline/relight.h); empty
/// without pictures.
std::string other_light(std::span<const RelitPictures> pictures, const nlohmann::json& metrics);

}  // namespace patina::report
