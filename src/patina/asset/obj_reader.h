// Wavefront OBJ and its material libraries.
#pragma once

#include "patina/asset/source_document.h"

namespace patina::asset {

/// Reads OBJ text with its MTL files. See obj_reader.cpp for what is understood and how it maps to
/// metallic-roughness.
Asset read_obj(const std::filesystem::path& path, std::vector<uint8_t> file);

}  // namespace patina::asset
