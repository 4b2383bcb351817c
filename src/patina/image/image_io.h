// Image files through OpenImageIO (PNG, JPEG, HDR, EXR), from disk or memory, with limits against hostile
// headers.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "patina/image/image.h"

namespace patina {

/// What a decoder may spend; a header that promises more, or more than its compressed bytes could hold, is
/// refused before anything is allocated.
struct ImageLimits {
  int max_side = 16384;
  uint64_t max_pixels = uint64_t{1} << 26;  // a gibibyte as four float channels
};

/// Decodes PNG/JPEG bytes. Values as stored, divided by the integer maximum: [0,1], no colour conversion
/// whatever the file's gamma, chromaticities or ICC profile say (glTF asks for that). 1 to 4 channels as
/// stored; palettes expanded. Throws Error{kFormat, kLimit} with `name` as context.
Image decode_image(std::span<const uint8_t> bytes, const std::string& name, const ImageLimits& limits = {});

/// Reads a PNG or JPEG file the same way.
Image read_image(const std::filesystem::path& path, const ImageLimits& limits = {});

/// An environment, and what a user should know of how it was read.
struct HdrImage {
  Image image;  // [H,W,3] linear Rec. 709, finite, not negative
  std::vector<std::string> notes;
};

/// Reads an HDR (Radiance) or EXR equirectangular map. A single channel is taken as grey; of an EXR with
/// layers the plain one or Combined is taken, else the layers are named in an error. Infinite values (a sun
/// that half floats cannot hold) are brought to the largest finite one, negative ones to zero; NaN is refused
/// (the error names the pixel).
HdrImage read_hdr_with_notes(const std::filesystem::path& path, const ImageLimits& limits = {});
Image read_hdr(const std::filesystem::path& path, const ImageLimits& limits = {});

/// Encodes to 8-bit PNG (1 to 4 channels, values clamped to [0,1], rounded to nearest), deterministic bytes.
std::vector<uint8_t> encode_png(const Image& image);

/// Writes atomically by extension: .png 8 bit as above, .jpg quality 92, .exr 32-bit float linear (exact).
void write_image(const std::filesystem::path& path, const Image& image);

}  // namespace patina
