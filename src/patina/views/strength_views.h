// Strength maps seen through the cameras: how strongly each pixel may be edited.
#pragma once

#include <span>
#include <vector>

#include "patina/asset/material_maps.h"
#include "patina/render/scene.h"

namespace patina::views {

/// The asset's primitives, without the context's.
inline std::span<const asset::Primitive* const> asset_primitives(const render::Scene& scene) {
  return std::span(scene.primitives()).first(static_cast<size_t>(scene.num_asset_primitives()));
}

/// `strengths`: one map a material of the asset (asset/strength_map.h). Returns one [H,W,1] a camera: the
/// mean over the asset's part of each pixel, from 2 × 2 rays that each read as many texels as they stand for.
/// 0 exactly where all of these texels are zero; -1 where a pixel shows nothing of the asset.
std::vector<Image> strength_views(const render::Scene& scene, std::span<const render::Camera> cameras,
                                  std::span<const asset::Map> strengths);

}  // namespace patina::views
