// A recovery's scene in plain arrays, for other renderers to start from.
#pragma once

#include <filesystem>

#include "recovery/recovery.h"

namespace patina::bench {

/// Writes the asset's first material and its triangles to `folder`: scene.json (cameras, exposure, sizes) and
/// raw little-endian arrays: p, n [V,3] and uv [V,2] f32, triangles [F,3] u32, environment [H,W,3] f32,
/// base_color [h,w,3], roughness, metallic [h,w,1] f32 (the truth), counted [h,w,1] f32 (1: texels that
/// errors are taken over).
void export_scene(const test::Recovery& recovery, int min_views, const std::filesystem::path& folder);

}  // namespace patina::bench
