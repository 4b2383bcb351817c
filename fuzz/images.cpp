// Targets: PNG and JPEG, Radiance HDR and OpenEXR.
#include <cmath>

#include "patina/image/image_header.h"
#include "patina/image/image_io.h"
#include "targets.h"

namespace patina::fuzz {
namespace {

// Larger ones would only be slow.
constexpr ImageLimits kSmall{.max_side = 512, .max_pixels = 1 << 16};

}  // namespace

void picture(std::span<const uint8_t> bytes) {
  mime_type(bytes);
  const ImageHeader header = inspect_image(bytes, "x.png");
  const std::vector<uint8_t> stripped = without_metadata(bytes);
  const ImageHeader again = inspect_image(stripped, "stripped.png");
  require(header.width == again.width && header.height == again.height && header.channels == again.channels,
          "what is stripped is the same picture");
  const Image image = decode_image(bytes, "x.png", kSmall);
  require(image.width == header.width && image.height == header.height, "the header tells the size");
  for (const float value : image.pixels) require(value >= 0 && value <= 1, "values lie in [0,1]");
}

void environment(std::span<const uint8_t> bytes) {
  inspect_hdr(bytes, "x.hdr", kSmall);
  without_metadata(bytes);
  const HdrImage read = read_hdr_with_notes(scratch_file("x.hdr", bytes), kSmall);
  for (const float value : read.image.pixels)
    require(std::isfinite(value) && value >= 0, "radiance is finite and not negative");
}

}  // namespace patina::fuzz
