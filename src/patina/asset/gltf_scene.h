// The default scene of a glTF file, flattened: meshes as triangles in world space, punctual lights [glTF2,
// Sec. 3.5].
#pragma once

#include "patina/asset/source_document.h"

namespace patina::asset {

/// Fills `asset.primitives` and `asset.lights`; needs asset.materials (normal maps decide which UV set
/// tangents follow), and appends the default material where a primitive needs it.
void read_scene(const SourceDocument& document, Asset& asset);

}  // namespace patina::asset
