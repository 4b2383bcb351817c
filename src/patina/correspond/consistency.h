// How well views agree: the edit (edited minus conditioning image) warped from view to view by ray-traced
// correspondences.
#pragma once

#include <span>
#include <vector>

#include "patina/views/view_set.h"

namespace patina::correspond {

/// Averages over every ordered pair of views (a, b): a's pixels against b's edit at the place where b sees
/// their surface point. A pixel counts by the surface area it shows, so that a patch weighs the same whether
/// it is seen head on or at an angle, from near or far.
struct Consistency {
  float edit_correlation = 0;  // Pearson, pairs weighted by co-visible area; NaN if nothing is co-visible or
                               // all edits are constant. Channels are centred one by one: a tint that all
                               // views share does not count as agreement
  float edit_psnr = 0;  // dB, peak 1, of the mean squared difference over co-visible area; NaN likewise
  int64_t covisible_pixels = 0;
  double covisible_area = 0;  // m², summed over ordered pairs
};

/// conditioning and edited: one sRGB [H,W,3] image a view. Pixels near the silhouette and at grazing angles
/// (view cosine below 0.2) are left out. Of a double-sided sheet b may see the other side. b's edit is read
/// bilinearly, so detail finer than a pixel of b costs correlation even where views agree.
Consistency edit_consistency(const render::Scene& scene, const views::ViewSet& views,
                             std::span<const Image> conditioning, std::span<const Image> edited);

}  // namespace patina::correspond
