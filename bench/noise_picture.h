// The picture of docs/noise.md: what two neighbouring views of an asset start from, published and exact
// noise.
#pragma once

#include "patina/asset/asset.h"
#include "patina/image/image.h"

namespace patina::bench {

/// [H,W,3] sRGB. First column: the two views, shaded by the view cosine. Then one row a mode, paper above
/// exact: the first view's noise, the second's warped into the first, and their difference over √2, which has
/// unit variance where they have nothing in common and vanishes where they agree. Three of the four channels
/// are shown as red, green and blue, mid-grey is zero and where the other view sees nothing. `views_a_turn`:
/// how many views a full turn would have.
Image noise_picture(const asset::Asset& asset, int views_a_turn);

}  // namespace patina::bench
