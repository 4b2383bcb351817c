// Resampling of display images for pages and contact sheets.
#pragma once

#include "patina/image/image.h"

namespace patina::report {

/// `image` at width × height: each pixel is the exact area average of what it covers when shrinking, bilinear
/// when enlarging. Values are averaged as they are; see scaled_srgb for display colours.
Image scaled(const Image& image, int width, int height);

/// The same for sRGB images [H,W,3], averaged in linear light so that fine detail keeps its brightness.
Image scaled_srgb(const Image& srgb, int width, int height);

/// [H,W,3] of an image with 1 to 4 channels: grey is repeated, alpha is dropped.
Image as_rgb(const Image& image);

}  // namespace patina::report
