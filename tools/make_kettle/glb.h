// Writes the kettle as one binary glTF 2.0 file.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "patch.h"
#include "textures.h"

namespace patina::kettle {

/// One mesh with a primitive a material; `textures` has one entry a material.
std::vector<uint8_t> kettle_glb(const std::vector<Patch>& patches,
                                const std::array<Textures, kNumMaterials>& textures);

}  // namespace patina::kettle
