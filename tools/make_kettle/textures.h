// The kettle's textures as it left the factory: enamel, brushed steel and oiled wood, evaluated at the
// surface point behind every texel. Nothing is worn: wear is what patina adds.
#pragma once

#include <vector>

#include "patch.h"
#include "patina/image/image.h"

namespace patina::kettle {

struct Textures {
  Image base_color;          // [N,N,3] sRGB
  Image metallic_roughness;  // [N,N,3] R unused (1), G roughness, B metallic, as glTF packs them
  Image normal;              // [N,N,3] tangent space, +Y up
};

/// Textures of one material, `size` texels a side. Texels beside an island repeat its border.
Textures make_textures(const std::vector<Patch>& patches, MaterialId material, int size);

}  // namespace patina::kettle
