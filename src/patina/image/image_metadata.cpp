// Takes metadata out of image files before they are decoded; see without_metadata in image_header.h. The
// structure was checked by inspect_image or inspect_hdr; still no read goes past the end.
#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

#include "patina/image/image_header.h"

namespace patina {
namespace {

using Bytes = std::span<const uint8_t>;

void append(std::vector<uint8_t>& out, Bytes bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

// Only critical chunks and transparency make pixels.
std::vector<uint8_t> png_pixels(Bytes bytes) {
  std::vector<uint8_t> out(bytes.begin(), bytes.begin() + 8);
  for (size_t at = 8; at + 12 <= bytes.size();) {
    const size_t length =
        size_t{bytes[at]} << 24 | size_t{bytes[at + 1]} << 16 | size_t{bytes[at + 2]} << 8 | bytes[at + 3];
    if (length > bytes.size() - at - 12) break;
    const std::string_view type(reinterpret_cast<const char*>(bytes.data()) + at + 4, 4);
    if (type == "IHDR" || type == "PLTE" || type == "tRNS" || type == "IDAT" || type == "IEND")
      append(out, bytes.subspan(at, length + 12));
    if (type == "IEND") break;
    at += length + 12;
  }
  return out;
}

// Application segments before the image data go, but for JFIF (APP0) and Adobe (APP14), which tell the colour
// transform.
std::vector<uint8_t> jpeg_pixels(Bytes bytes) {
  std::vector<uint8_t> out(bytes.begin(), bytes.begin() + 2);
  size_t at = 2;
  while (at + 4 <= bytes.size()) {
    const int marker = bytes[at + 1];
    if (bytes[at] != 0xFF || marker == 0xDA) break;
    if (marker == 0xFF || marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8)) {
      at += marker == 0xFF ? 1 : 2;
      continue;
    }
    const size_t length = size_t{bytes[at + 2]} << 8 | bytes[at + 3];
    if (length + 2 > bytes.size() - at) break;
    const bool application = marker >= 0xE0 && marker <= 0xEF && marker != 0xE0 && marker != 0xEE;
    if (!application && marker != 0xFE) append(out, bytes.subspan(at, length + 2));
    at += length + 2;
  }
  append(out, bytes.subspan(at));
  return out;
}

// The header's length cannot change, since blocks are found by their place in the file: attributes that do
// not place pixels get a type of the same length that nobody knows, and are then carried unread.
std::vector<uint8_t> exr_pixels(Bytes bytes) {
  constexpr std::array<std::string_view, 13> kPlacesPixels = {"channels",
                                                              "compression",
                                                              "dataWindow",
                                                              "displayWindow",
                                                              "lineOrder",
                                                              "pixelAspectRatio",
                                                              "screenWindowCenter",
                                                              "screenWindowWidth",
                                                              "tiles",
                                                              "type",
                                                              "version",
                                                              "chunkCount",
                                                              "name"};
  std::vector<uint8_t> out(bytes.begin(), bytes.end());
  const auto end_of_word = [&](size_t at) {
    const auto* begin = out.data() + at;
    const void* end = std::memchr(begin, 0, out.size() - at);
    return end ? static_cast<size_t>(static_cast<const uint8_t*>(end) - out.data()) : out.size();
  };
  for (size_t at = 8; at < out.size() && out[at] != 0;) {
    const size_t name_end = end_of_word(at);
    if (name_end + 1 >= out.size()) break;
    const size_t type_end = end_of_word(name_end + 1);
    if (out.size() - type_end < 5) break;
    const std::string_view name(reinterpret_cast<const char*>(out.data()) + at, name_end - at);
    if (std::find(kPlacesPixels.begin(), kPlacesPixels.end(), name) == kPlacesPixels.end())
      std::fill(out.begin() + static_cast<std::ptrdiff_t>(name_end + 1),
                out.begin() + static_cast<std::ptrdiff_t>(type_end), uint8_t{'-'});
    const size_t length = size_t{out[type_end + 4]} << 24 | size_t{out[type_end + 3]} << 16 |
                          size_t{out[type_end + 2]} << 8 | out[type_end + 1];
    if (length > out.size() - type_end - 5) break;
    at = type_end + 5 + length;
  }
  return out;
}

}  // namespace

std::vector<uint8_t> without_metadata(Bytes bytes) {
  const auto format = image_format(bytes);
  if (format == ImageFormat::kPng) return png_pixels(bytes);
  if (format == ImageFormat::kJpeg) return jpeg_pixels(bytes);
  if (format == ImageFormat::kExr) return exr_pixels(bytes);
  return {bytes.begin(), bytes.end()};
}

}  // namespace patina
