// Changed maps back into what a material stores: images in the file's own encoding, and the factors beside
// them.
#pragma once

#include "patina/asset/material_maps.h"

namespace patina::asset {

/// Images hold stored values [0,1] (sRGB base colour, encoded normals), ready for an 8-bit file. Only changed
/// slots are filled.
struct BakedMaterial {
  std::optional<Image> base_color;  // [3], or [4] where the old image had alpha
  vec3 base_color_factor{1.0f};
  std::optional<Image> metallic_roughness;  // [3] or [4]: roughness in G, metallic in B, R and A as they were
  float roughness_factor = 1.0f;
  float metallic_factor = 1.0f;
  std::optional<Image> normal;  // [3]
  float normal_scale = 1.0f;
};

/// Factors are kept where every texel can be written as factor × stored value with a stored value of at most
/// one; else they become one. A slot that had no texture gets factor one, and the packed partner that was not
/// changed keeps its factor under a channel of ones. A texel that is as in `before`, the asset's own maps,
/// keeps its stored value where the texture keeps its size and its factor.
BakedMaterial baked(const Asset& asset, const Material& material, const MaterialMaps& before,
                    const MaterialMaps& maps, const MapSet& changed);

}  // namespace patina::asset
