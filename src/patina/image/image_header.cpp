#include "patina/image/image_header.h"

#include <zlib.h>

#include <array>
#include <cstring>
#include <string_view>

#include <fmt/format.h>

#include "patina/base/error.h"

namespace patina {
namespace {

using Bytes = std::span<const uint8_t>;

[[noreturn]] void fail(const std::string& name, const std::string& message,
                       ErrorCode code = ErrorCode::kFormat) {
  throw Error(code, name, message);
}

bool starts_with(Bytes bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

uint32_t big_u32(Bytes b, size_t at) {
  return uint32_t{b[at]} << 24 | uint32_t{b[at + 1]} << 16 | uint32_t{b[at + 2]} << 8 | b[at + 3];
}
uint32_t big_u16(Bytes b, size_t at) {
  return uint32_t{b[at]} << 8 | b[at + 1];
}

// A size that patina accepts, and that `max_bytes_held` raw bytes (what the compressed data can at most
// expand to) can fill.
void check_size(const std::string& name, uint64_t width, uint64_t height, uint64_t bits_a_pixel,
                uint64_t max_bytes_held, const ImageLimits& limits) {
  if (width == 0 || height == 0) fail(name, fmt::format("the image is {} x {} pixels", width, height));
  const auto max_side = static_cast<uint64_t>(limits.max_side);
  if (width > max_side || height > max_side || width * height > limits.max_pixels)
    fail(name,
         fmt::format("the image claims {} x {} pixels; at most {} a side and {} in all are accepted", width,
                     height, max_side, limits.max_pixels),
         ErrorCode::kLimit);
  const uint64_t needed = (width * bits_a_pixel + 7) / 8 * height;
  if (needed > max_bytes_held)
    fail(name, fmt::format("the image claims {} x {} pixels, more than its compressed data can hold", width,
                           height));
}

// ---- PNG
// ----------------------------------------------------------------------------------------------------------

// Deflate cannot do better than 258 bytes from two bits [RFC1951], i.e. 1032:1.
constexpr uint64_t kMaxDeflateRatio = 1032;

struct PngColor {
  int channels;
  std::string_view allowed_depths;
};

std::optional<PngColor> png_color(int color_type) {
  switch (color_type) {
    case 0:
      return PngColor{1, "\1\2\4\10\20"};
    case 2:
      return PngColor{3, "\10\20"};
    case 3:
      return PngColor{1, "\1\2\4\10"};
    case 4:
      return PngColor{2, "\10\20"};
    case 6:
      return PngColor{4, "\10\20"};
    default:
      return std::nullopt;
  }
}

ImageHeader inspect_png(Bytes bytes, const std::string& name, const ImageLimits& limits) {
  ImageHeader header{ImageFormat::kPng, 0, 0, 0};
  PngColor color{};
  int depth = 0, color_type = 0;
  uint64_t idat_bytes = 0;
  bool in_idat = false, idat_ended = false, ended = false, has_palette = false, has_transparency = false;
  for (size_t at = 8; !ended;) {
    if (bytes.size() - at < 12) fail(name, "the PNG file is cut short: it ends before its IEND chunk");
    const uint64_t length = big_u32(bytes, at);
    const std::string_view type(reinterpret_cast<const char*>(bytes.data()) + at + 4, 4);
    if (length > bytes.size() - at - 12)
      fail(name, fmt::format("the PNG file is cut short: chunk {} of {} bytes reaches past its end",
                             printable(type), length));
    const Bytes data = bytes.subspan(at + 8, length);
    const bool critical = (static_cast<unsigned char>(type[0]) & 0x20u) == 0;
    if (critical &&
        ::crc32(0, bytes.data() + at + 4, static_cast<uInt>(length + 4)) != big_u32(bytes, at + 8 + length))
      fail(name, fmt::format("the checksum of PNG chunk {} is wrong; the file is damaged", printable(type)));
    if (header.width == 0) {
      if (type != "IHDR" || length != 13)
        fail(name, "the PNG file does not begin with an IHDR chunk of 13 bytes");
      depth = data[8], color_type = data[9];
      const auto found = png_color(color_type);
      if (!found) fail(name, fmt::format("PNG colour type is {}, expected 0, 2, 3, 4 or 6", color_type));
      if (found->allowed_depths.find(static_cast<char>(depth)) == std::string_view::npos)
        fail(name, fmt::format("PNG bit depth {} is not allowed with colour type {}", depth, color_type));
      if (data[10] != 0 || data[11] != 0 || data[12] > 1)
        fail(name, "PNG compression, filter or interlace method is unknown");
      color = *found;
      check_size(name, big_u32(data, 0), big_u32(data, 4), 1, UINT64_MAX, limits);
      header.width = static_cast<int>(big_u32(data, 0));
      header.height = static_cast<int>(big_u32(data, 4));
    } else if (type == "IHDR") {
      fail(name, "the PNG file has two IHDR chunks");
    } else if (type == "PLTE") {
      has_palette = length > 0;
    } else if (type == "tRNS") {
      has_transparency = true;
    } else if (type == "IDAT") {
      if (idat_ended) fail(name, "the PNG file's IDAT chunks do not follow one another");
      in_idat = true;
      idat_bytes += length;
    } else if (type == "IEND") {
      ended = true;
    }
    if (in_idat && type != "IDAT") idat_ended = true;
    at += 12 + length;
  }
  if (idat_bytes == 0) fail(name, "the PNG file holds no image data (no IDAT chunk)");
  if (color_type == 3 && !has_palette)
    fail(name, "the PNG file has palette colour but no palette (PLTE chunk)");
  check_size(name, static_cast<uint64_t>(header.width), static_cast<uint64_t>(header.height),
             static_cast<uint64_t>(depth) * static_cast<uint64_t>(color.channels),
             idat_bytes * kMaxDeflateRatio, limits);
  header.channels = (color_type == 3 ? 3 : color.channels) + (has_transparency && color_type <= 3 ? 1 : 0);
  return header;
}

// ---- JPEG
// ---------------------------------------------------------------------------------------------------------

// A Huffman-coded 8 × 8 block takes at least two bits a component in a baseline scan, and progressive
// end-of-band runs cover up to 32767 blocks with a few bytes [JPEG, Sec. G.1.2.2]; the first DC scan still
// needs one bit a block.
constexpr uint64_t kMaxJpegPixelsAByte = 8 * 64 * 16;  // 16: chroma at its coarsest, luma blocks 4 × 4 a unit

ImageHeader inspect_jpeg(Bytes bytes, const std::string& name, const ImageLimits& limits) {
  ImageHeader header{ImageFormat::kJpeg, 0, 0, 0};
  size_t at = 2;
  for (bool scan = false; !scan;) {
    if (at + 4 > bytes.size()) fail(name, "the JPEG file is cut short: it ends before its image data");
    if (bytes[at] != 0xFF)
      fail(name, fmt::format("the JPEG file has no marker at byte {}; it is damaged", at));
    const int marker = bytes[at + 1];
    if (marker == 0xFF) {  // fill byte
      ++at;
      continue;
    }
    if (marker == 0xD9) fail(name, "the JPEG file holds no image data");
    if (marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8)) {  // markers without a segment
      at += 2;
      continue;
    }
    const size_t length = big_u16(bytes, at + 2);
    if (length < 2 || length > bytes.size() - at - 2)
      fail(name, "the JPEG file is cut short: a segment reaches past its end");
    const Bytes data = bytes.subspan(at + 4, length - 2);
    if (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC) {
      if (header.width) fail(name, "the JPEG file has two frame headers");
      if (data.size() < 6) fail(name, "the JPEG frame header is too short");
      if (marker > 0xC2)
        fail(name,
             "the JPEG file is lossless, hierarchical or arithmetic-coded; save it as baseline or "
             "progressive JPEG",
             ErrorCode::kUnsupported);
      if (data[0] != 8)
        fail(name, fmt::format("the JPEG file has {} bits a channel, expected 8", data[0]),
             ErrorCode::kUnsupported);
      if (data[5] == 4) fail(name, "the JPEG file is CMYK; save it as RGB", ErrorCode::kUnsupported);
      if (data[5] != 1 && data[5] != 3)
        fail(name, fmt::format("the JPEG file has {} channels, expected 1 or 3", data[5]));
      check_size(name, big_u16(data, 3), big_u16(data, 1), 8, bytes.size() * kMaxJpegPixelsAByte, limits);
      header.width = static_cast<int>(big_u16(data, 3));
      header.height = static_cast<int>(big_u16(data, 1));
      header.channels = data[5];
    }
    scan = marker == 0xDA;
    at += 2 + length;
  }
  if (!header.width) fail(name, "the JPEG file has image data before its frame header");
  // Inside entropy-coded data FF is always followed by 00 or a marker, so FF D9 can only be the end of the
  // image.
  for (size_t i = at; i + 1 < bytes.size(); ++i)
    if (bytes[i] == 0xFF && bytes[i + 1] == 0xD9) return header;
  fail(name, "the JPEG file is cut short: it has no end-of-image marker");
}

// ---- Radiance HDR
// -------------------------------------------------------------------------------------------------

ImageHeader inspect_radiance(Bytes bytes, const std::string& name, const ImageLimits& limits) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  size_t at = 0;
  const auto line = [&]() -> std::string_view {
    const size_t end = text.find('\n', at);
    if (end == std::string_view::npos || end - at > 4096)
      fail(name, "the HDR file is cut short or its header is damaged");
    const auto result = text.substr(at, end - at);
    at = end + 1;
    return result;
  };
  bool format_known = false;
  line();  // #?RADIANCE or #?RGBE
  for (auto l = line(); !l.empty(); l = line()) {
    if (!l.starts_with("FORMAT=")) continue;
    format_known = l.starts_with("FORMAT=32-bit_rle_rgbe");
    if (!format_known)
      fail(name, fmt::format("HDR pixel format is {}, expected 32-bit_rle_rgbe", printable(l.substr(7))),
           ErrorCode::kUnsupported);
  }
  if (!format_known) fail(name, "the HDR header has no FORMAT=32-bit_rle_rgbe line");
  const std::string size_line(line());
  long long height = 0, width = 0;
  char y_sign = 0, x_sign = 0;
  int used = 0;
  if (std::sscanf(size_line.c_str(), "%cY %lld %cX %lld%n", &y_sign, &height, &x_sign, &width, &used) != 4 ||
      y_sign != '-' || x_sign != '+')
    fail(name,
         fmt::format("the HDR resolution line is '{}', expected '-Y height +X width'", printable(size_line)));
  if (width <= 0 || height <= 0) fail(name, fmt::format("the HDR image is {} x {} pixels", width, height));
  // Adaptive run-length coding gives at most 127 bytes for two; the old coding repeats a pixel without a
  // bound that matters here.
  const uint64_t data_bytes = bytes.size() - at;
  check_size(name, static_cast<uint64_t>(width), static_cast<uint64_t>(height), 32, data_bytes * 64, limits);
  return {ImageFormat::kHdr, static_cast<int>(width), static_cast<int>(height), 3};
}

// ---- OpenEXR
// ------------------------------------------------------------------------------------------------------

uint32_t little_u32(Bytes b, size_t at) {
  return uint32_t{b[at + 3]} << 24 | uint32_t{b[at + 2]} << 16 | uint32_t{b[at + 1]} << 8 | b[at];
}

ImageHeader inspect_exr(Bytes bytes, const std::string& name, const ImageLimits& limits) {
  if (bytes.size() < 8) fail(name, "the EXR file is cut short");
  const uint32_t version = little_u32(bytes, 4);
  if ((version & 0xFFu) != 2)
    fail(name, fmt::format("EXR version is {}, expected 2", version & 0xFFu), ErrorCode::kUnsupported);
  if (version & 0x800u)
    fail(name, "the EXR file holds deep data, which has no flat pixels", ErrorCode::kUnsupported);
  if (version & 0x1000u)
    fail(name, "the EXR file has several parts; save the environment as a single part",
         ErrorCode::kUnsupported);
  // Attributes: name\0 type\0 size value, ended by an empty name as OpenEXR's file layout describes.
  size_t at = 8;
  const auto word = [&]() -> std::string_view {
    const auto* begin = reinterpret_cast<const char*>(bytes.data()) + at;
    const void* end = std::memchr(begin, 0, std::min<size_t>(bytes.size() - at, 256));
    if (!end) fail(name, "the EXR header is cut short or damaged");
    const std::string_view text(begin, static_cast<size_t>(static_cast<const char*>(end) - begin));
    at += text.size() + 1;
    return text;
  };
  std::optional<std::array<int32_t, 4>> window;
  for (auto attribute = word(); !attribute.empty(); attribute = word()) {
    const auto type = word();
    if (bytes.size() - at < 4) fail(name, "the EXR header is cut short");
    const uint64_t size = little_u32(bytes, at);
    at += 4;
    if (size > bytes.size() - at)
      fail(name, fmt::format("the EXR attribute {} reaches past the end of the file", printable(attribute)));
    if (attribute == "dataWindow" && type == "box2i" && size == 16) {
      window.emplace();
      for (size_t k = 0; k < 4; ++k) (*window)[k] = static_cast<int32_t>(little_u32(bytes, at + 4 * k));
    }
    at += size;
  }
  if (!window) fail(name, "the EXR header has no dataWindow");
  const int64_t width = int64_t{(*window)[2]} - (*window)[0] + 1,
                height = int64_t{(*window)[3]} - (*window)[1] + 1;
  if (width <= 0 || height <= 0) fail(name, fmt::format("the EXR image is {} x {} pixels", width, height));
  // Every scanline block or tile has an offset of eight bytes; DWA may describe a flat block in a few bytes
  // more.
  check_size(name, static_cast<uint64_t>(width), static_cast<uint64_t>(height), 48,
             bytes.size() * kMaxDeflateRatio * 8, limits);
  return {ImageFormat::kExr, static_cast<int>(width), static_cast<int>(height), 3};
}

std::string what_it_is(Bytes bytes) {
  if (bytes.empty()) return "the file is empty";
  if (starts_with(bytes, "GIF8")) return "it is a GIF file";
  if (starts_with(bytes, "RIFF")) return "it is a WebP or other RIFF file";
  if (starts_with(bytes, "\xABKTX")) return "it is a KTX file";
  if (starts_with(bytes, "BM")) return "it is a BMP file";
  return "its first bytes are those of neither";
}

}  // namespace

std::optional<ImageFormat> image_format(Bytes bytes) {
  if (starts_with(bytes, "\x89PNG\r\n\x1A\n")) return ImageFormat::kPng;
  if (starts_with(bytes, "\xFF\xD8\xFF")) return ImageFormat::kJpeg;
  if (starts_with(bytes, "#?RADIANCE") || starts_with(bytes, "#?RGBE")) return ImageFormat::kHdr;
  if (starts_with(bytes, "\x76\x2F\x31\x01")) return ImageFormat::kExr;
  return std::nullopt;
}

std::string_view mime_type(Bytes bytes) {
  if (starts_with(bytes, "\x89PNG\r\n\x1A\n")) return "image/png";
  if (starts_with(bytes, "\xFF\xD8\xFF")) return "image/jpeg";
  if (starts_with(bytes, "RIFF") && bytes.size() >= 12 && starts_with(bytes.subspan(8), "WEBP"))
    return "image/webp";
  if (starts_with(bytes, "\xABKTX 20\xBB")) return "image/ktx2";
  if (starts_with(bytes, "DDS ")) return "image/vnd-ms.dds";
  if (bytes.size() >= 12 && starts_with(bytes.subspan(4), "ftyp")) {
    // The major brand, or a compatible one, is avif (or avis, a sequence).
    const std::string_view box(reinterpret_cast<const char*>(bytes.data()),
                               std::min<size_t>(bytes.size(), 64));
    if (box.find("avif") != box.npos || box.find("avis") != box.npos) return "image/avif";
  }
  return {};
}

ImageHeader inspect_image(Bytes bytes, const std::string& name, const ImageLimits& limits) {
  const auto format = image_format(bytes);
  if (format == ImageFormat::kPng) return inspect_png(bytes, name, limits);
  if (format == ImageFormat::kJpeg) return inspect_jpeg(bytes, name, limits);
  fail(name, fmt::format("is not a PNG or JPEG image: {}", what_it_is(bytes)));
}

ImageHeader inspect_hdr(Bytes bytes, const std::string& name, const ImageLimits& limits) {
  const auto format = image_format(bytes);
  if (format == ImageFormat::kHdr) return inspect_radiance(bytes, name, limits);
  if (format == ImageFormat::kExr) return inspect_exr(bytes, name, limits);
  fail(name, fmt::format("is not a Radiance HDR or OpenEXR image: {}", what_it_is(bytes)));
}

}  // namespace patina
