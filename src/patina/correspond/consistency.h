// How well views agree: the edit (edited minus conditioning image) warped from view to view by ray-traced
// correspondences.
#pragma once

#include <span>
#include <vector>

#include "patina/views/view_set.h"

namespace patina::correspond {

struct Consistency {
  float edit_correlation = 0;  // Pearson, mean over ordered pairs of views weighted by co-visible pixels; NaN
                               // if nothing is co-visible
  float edit_psnr = 0;         // dB, peak 1, of the warped edits' difference
  int64_t covisible_pixels = 0;
};

/// conditioning and edited: one sRGB [H,W,3] image a view. Pixels near the silhouette and at grazing angles
/// (view cosine below 0.2) are left out.
Consistency edit_consistency(const render::Scene& scene, const views::ViewSet& views,
                             std::span<const Image> conditioning, std::span<const Image> edited);

}  // namespace patina::correspond
