// The asset before and after as the report's viewer (web/viewer.js) reads it: geometry once, the maps of
// both, and lights.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/render/environment.h"

namespace patina::report {

/// An environment to choose, and the exposure at which the asset is shown in it.
struct ViewerLight {
  std::string name;  // for people: "studio, as in the views"
  const render::Environment* environment;
  float exposure_ev = 0;
};

struct ViewerScene {
  const asset::Asset* asset;
  std::span<const asset::MaterialMaps> before, after;  // one a material
  std::span<const asset::MapSet> changed;              // maps where `after` differs
  std::span<const ViewerLight> lights;                 // the first is shown first
};

/// Triangles up to which a page carries the geometry: about 20 bytes each in the page.
inline constexpr size_t kMaxViewerTriangles = 250'000;

/// One JSON object, ASCII without '<', so that it can stand inside of a <script>; empty for an asset with
/// more than kMaxViewerTriangles. Maps are shrunk to 1024 texels a side, fewer where there are many.
std::string viewer_data(const ViewerScene& scene);

/// "data:<mime>;base64,..." of radiance [H,W,3] as [H,W,4] u8 with a shared exponent in the last byte, value
/// = mantissa · 2^(exponent − 136) [Ward1991], the lowest row first.
std::string shared_exponent_uri(const Image& radiance);

}  // namespace patina::report
