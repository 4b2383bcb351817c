// The pictures of an ablation: views as a grid, and one surface point cut out of several views and of the
// textures.
#pragma once

#include "patina/pipeline/pick_point.h"
#include "patina/pipeline/stages.h"
#include "patina/report/ablation_page.h"

namespace patina::pipeline {

/// A square window around the surface point in a view, in pixels, inside of the picture.
struct CropWindow {
  int view = 0, left = 0, top = 0, side = 0;
};

/// The same point in at most `max_crops` views, first the one in which it was picked.
std::vector<CropWindow> crop_windows(const PickedPoint& point, const views::ViewSet& views, int max_crops);

/// All views as one grid, shrunk to what a page shows, and what the windows cut out. `framed`: the grid shows
/// where the windows are.
report::AblationRow pictures_of(std::span<const Image> views, std::span<const CropWindow> windows,
                                bool framed);

/// Base colour of the point's material, sRGB: all of it, and a window around the point's texel.
struct TexturePictures {
  Image whole, around_point;
};
TexturePictures texture_pictures(const render::Scene& scene, const views::ViewSet& views,
                                 const PickedPoint& point, const std::vector<asset::MaterialMaps>& maps);

/// The window of one view.
Image cropped(const Image& view, const CropWindow& window);

}  // namespace patina::pipeline
