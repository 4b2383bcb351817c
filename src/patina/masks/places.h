// Strength maps from the shape of the asset: its edges, crevices and cavities, what faces up or down, and
// where water would run.
#pragma once

#include <span>

#include "patina/asset/material_maps.h"
#include "patina/base/progress.h"
#include "patina/render/scene.h"

namespace patina::masks {

enum class Place {
  kEdges,     // the surface bends away, or its normal map does
  kCrevices,  // it is closed in nearby, or its normal map is a groove
  kCavities,  // it is closed in within half the asset's radius (ambient occlusion)
  kUp,        // it faces up (+Y), normal map included
  kDown,
  kDrips,  // streaks down steep surface from its upper rims
};

struct PlaceAmount {
  Place place = Place::kEdges;
  float amount = 1;  // (0,1]: strength where the place is most pronounced
};

/// width × height texels of `material`, laid out as `like`: the largest of the places' values, each times its
/// amount; going on a little beyond the surface. Takes a texel's rays from its own place, so seams do not
/// show. Progress counts under the task "masks".
asset::Map place_strength(const render::Scene& scene, const asset::Map& like, int width, int height,
                          int material, std::span<const PlaceAmount> places, const Progress& progress);

}  // namespace patina::masks
