// What an image file says of itself, read and checked before any decoder sees it: a hostile header must not
// make a decoder allocate, and a file that is cut short must not pass as a picture.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "patina/image/image_io.h"

namespace patina {

enum class ImageFormat { kPng, kJpeg, kHdr, kExr };

/// `channels` as the decoder will return them (palettes expanded, transparency as alpha).
struct ImageHeader {
  ImageFormat format = ImageFormat::kPng;
  int width = 0;
  int height = 0;
  int channels = 0;
};

/// The format that the first bytes announce; file names and mime types are not asked.
std::optional<ImageFormat> image_format(std::span<const uint8_t> bytes);

/// MIME type of an image file's bytes, for the kinds that glTF and its extensions hold: PNG, JPEG, WebP, KTX
/// 2, AVIF, DDS; empty for any other.
std::string_view mime_type(std::span<const uint8_t> bytes);

/// Reads and checks the structure of a PNG [PNG, Sec. 5 and 11] or JPEG [JPEG, Annex B] file: chunks or
/// markers in order and whole, a size within `limits` that the compressed bytes could hold. Throws
/// Error{kFormat, kUnsupported, kLimit}, `name` as context.
ImageHeader inspect_image(std::span<const uint8_t> bytes, const std::string& name,
                          const ImageLimits& limits = {});

/// The same for Radiance HDR and OpenEXR.
ImageHeader inspect_hdr(std::span<const uint8_t> bytes, const std::string& name,
                        const ImageLimits& limits = {});

/// `bytes` of an inspected file with nothing left but what makes the pixels: text, Exif, XMP, ICC, gamma and
/// application data are taken out (PNG, JPEG) or made opaque (EXR). Decoders parse such data although no one
/// asks for it, and some crash on it.
std::vector<uint8_t> without_metadata(std::span<const uint8_t> bytes);

}  // namespace patina
