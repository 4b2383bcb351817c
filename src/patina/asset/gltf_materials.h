// glTF materials, textures, samplers and their images [glTF2, Sec. 3.8 and 3.9].
#pragma once

#include "patina/asset/source_document.h"

namespace patina::asset {

/// Fills `asset.materials`, `asset.images` (one entry a glTF image, decoded where a material refers to it)
/// and `asset.image_names`.
void read_materials(SourceDocument& document, Asset& asset);

/// The material that glTF prescribes for primitives without one.
Material default_material();

/// A name from a file, short enough to be kept many times.
std::string short_name(const std::string& name);

}  // namespace patina::asset
