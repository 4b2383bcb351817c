// What a run did to the materials, in numbers that a page can put into words.
#pragma once

#include <nlohmann/json.hpp>

#include "patina/pipeline/stages.h"

namespace patina::pipeline {

/// One entry a material that the fit changed:
///   {"material", "changed": names of maps, "color": [before, after], "roughness": [..], "metallic": [..],
///    "seen"}
/// Means over the material's surface, colours as [r,g,b] sRGB; "seen" is the share that some view sees.
nlohmann::json what_changed(const Workbench& bench, const FittedMaterials& fitted);

/// {"down", "up", "sideways"}: shares of the surface that no view sees (views/visibility.h).
nlohmann::json what_was_not_seen(const Workbench& bench);

}  // namespace patina::pipeline
