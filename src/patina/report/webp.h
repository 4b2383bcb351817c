// Lossy WebP, which every browser shows: stills for the page, animations for turntables.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "patina/image/image.h"

namespace patina::report {

/// `image` [H,W,3] sRGB (clamped to [0,1], rounded to 8 bits) at most 16383 pixels a side; quality in
/// [0,100]. Throws Error{kIo}.
std::vector<uint8_t> encode_webp(const Image& image, float quality);

/// `frames` ([H,W,3] sRGB, one size, at least one) as an endless animation that lasts `seconds`. Throws
/// Error{kUsage, kIo}.
std::vector<uint8_t> encode_webp_animation(std::span<const Image> frames, float seconds, float quality);

}  // namespace patina::report
