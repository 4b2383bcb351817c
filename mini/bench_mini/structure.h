// What an edit left of the picture it started from: edges inside the object, and the ground around it.
#pragma once

#include <cstdint>
#include <vector>

#include "patina/image/image.h"

namespace patina::bench {

/// Pixels where the luma of a picture changes fastest across, [H·W] 0 or 1: maxima along the gradient of a
/// Gaussian of σ = 1 pixel that reach `threshold` (sRGB units a pixel) [Canny1986].
std::vector<uint8_t> edge_map(const Image& srgb, float threshold = 0.03f);

/// Share of the edges of one picture that have an edge of the other within `tolerance` pixels, and the
/// reverse.
struct EdgeMatch {
  int64_t num_edited = 0, edited_matched = 0;      // precision: edges of the edit that were there
  int64_t num_original = 0, original_matched = 0;  // recall: edges that are still there
  double precision() const;
  double recall() const;
  /// Harmonic mean of both; NaN where one of them has no edges.
  double f_score() const;
  void add(const EdgeMatch& other);
};
/// Only edges on pixels with `counts` ≠ 0 are counted; they may match any edge of the other picture. [H·W]
/// each.
EdgeMatch match_edges(const std::vector<uint8_t>& edited, const std::vector<uint8_t>& original,
                      const std::vector<uint8_t>& counts, int width, float tolerance = 2.0f);

/// Pixels whose distance to the nearest pixel with `inside` ≠ 0, the larger of those in x and y, lies in
/// [nearest, farthest]; at distance 0 are the inside pixels themselves. [H·W] 0 or 1.
std::vector<uint8_t> ring(const std::vector<uint8_t>& inside, int width, int nearest, int farthest);

/// Mean absolute difference of two pictures over marked pixels and channels, sRGB units; NaN if none is
/// marked.
double mean_change(const Image& a, const Image& b, const std::vector<uint8_t>& marked);

}  // namespace patina::bench
