#include "patina/image/image_io.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/image/image_header.h"

namespace patina {
namespace {

// OpenImageIO starts a thread pool and spreads EXR work over it; patina parallelises over images itself. Its
// own size limit is a second net under inspect_image.
void configure_oiio() {
  static std::once_flag once;
  std::call_once(once, [] {
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1);
    OIIO::attribute("limits:imagesize_MB", 2048);
    OIIO::attribute("limits:channels", 64);
  });
}

std::string last_error(const std::string& message) {
  const std::string text = message.empty() ? OIIO::geterror() : message;
  const size_t end = text.find('\n');
  return text.empty() ? "the decoder gives no reason" : text.substr(0, end);
}

const char* plugin_name(ImageFormat format) {
  switch (format) {
    case ImageFormat::kPng:
      return "png";
    case ImageFormat::kJpeg:
      return "jpeg";
    case ImageFormat::kHdr:
      return "hdr";
    case ImageFormat::kExr:
      return "openexr";
  }
  return "";
}

// An opened decoder over bytes in memory. The proxy must outlive the input.
struct Decoder {
  std::vector<uint8_t> pure;
  OIIO::Filesystem::IOMemReader proxy;
  std::unique_ptr<OIIO::ImageInput> input;
  OIIO::ImageSpec spec;

  Decoder(std::span<const uint8_t> bytes, const ImageHeader& header, const std::string& name)
      : pure(without_metadata(bytes)),
        proxy(pure.data(), pure.size()),
        input(OIIO::ImageInput::create(plugin_name(header.format))) {
    if (!input)
      throw Error(
          ErrorCode::kUnsupported, name,
          fmt::format("this OpenImageIO cannot read {}: {}", plugin_name(header.format), OIIO::geterror()));
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);  // glTF stores colour that is not multiplied by alpha
    input->set_ioproxy(&proxy);
    if (!input->open(name, spec, config))
      throw Error(ErrorCode::kFormat, name, "the image cannot be decoded: " + last_error(input->geterror()));
    if (spec.width != header.width || spec.height != header.height || spec.depth > 1 || spec.deep ||
        spec.nchannels < 1)
      throw Error(ErrorCode::kFormat, name,
                  fmt::format("the image is {} x {} with {} channels, its header says {} x {}", spec.width,
                              spec.height, spec.nchannels, header.width, header.height));
  }

  template <class T>
  std::vector<T> pixels(OIIO::TypeDesc type, int num_channels, const std::string& name) {
    std::vector<T> out(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height) *
                       static_cast<size_t>(num_channels));
    if (!input->read_image(0, 0, 0, num_channels, type, out.data()))
      throw Error(ErrorCode::kFormat, name, "the image cannot be decoded: " + last_error(input->geterror()));
    return out;
  }
};

// Exceptions of the decoders' libraries (OpenEXR throws) become ours.
template <class Function>
auto decoding(const std::string& name, Function function) {
  try {
    return function();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw Error(ErrorCode::kLimit, name, "the image needs more memory than there is");
  } catch (const std::exception& e) {
    throw Error(ErrorCode::kFormat, name, std::string("the image cannot be decoded: ") + e.what());
  }
}

template <class T>
Image to_unit_range(const std::vector<T>& stored, int width, int height, int channels) {
  Image image(width, height, channels);
  constexpr auto kMaximum = static_cast<float>(std::numeric_limits<T>::max());
  std::transform(stored.begin(), stored.end(), image.pixels.begin(),
                 [](T v) { return static_cast<float>(v) / kMaximum; });
  return image;
}

// Encodes through OpenImageIO into memory.
std::vector<uint8_t> encode(const Image& image, const char* format, const OIIO::ImageSpec& spec,
                            OIIO::TypeDesc type, const void* pixels) {
  configure_oiio();
  PATINA_CHECK(!image.empty());
  OIIO::Filesystem::IOVecOutput proxy;
  auto output = OIIO::ImageOutput::create(format);
  if (!output || !output->set_ioproxy(&proxy) || !output->open(std::string("memory.") + format, spec) ||
      !output->write_image(type, pixels) || !output->close())
    throw Error(ErrorCode::kIo, "",
                fmt::format("a {} image of {} x {} pixels cannot be encoded: {}", format, image.width,
                            image.height, last_error(output ? output->geterror() : "")));
  return proxy.buffer();
}

std::vector<uint8_t> encode_8_bit(const Image& image, const char* format, int quality) {
  std::vector<uint8_t> stored(image.pixels.size());
  // !(v > 0) also sends NaN to zero.
  std::transform(image.pixels.begin(), image.pixels.end(), stored.begin(), [](float v) {
    return !(v > 0.0f) ? uint8_t{0} : static_cast<uint8_t>(std::min(v, 1.0f) * 255.0f + 0.5f);
  });
  OIIO::ImageSpec spec(image.width, image.height, image.channels, OIIO::TypeDesc::UINT8);
  if (image.channels == 2 || image.channels == 4) spec.alpha_channel = image.channels - 1;
  spec.attribute("oiio:UnassociatedAlpha", 1);
  if (quality > 0) spec.attribute("Compression", fmt::format("jpeg:{}", quality));
  return encode(image, format, spec, OIIO::TypeDesc::UINT8, stored.data());
}

std::vector<uint8_t> encode_exr(const Image& image) {
  OIIO::ImageSpec spec(image.width, image.height, image.channels, OIIO::TypeDesc::FLOAT);
  spec.attribute("compression", "zip");
  return encode(image, "exr", spec, OIIO::TypeDesc::FLOAT, image.pixels.data());
}

}  // namespace

Image decode_image(std::span<const uint8_t> bytes, const std::string& name, const ImageLimits& limits) {
  configure_oiio();
  const ImageHeader header = inspect_image(bytes, name, limits);
  return decoding(name, [&] {
    Decoder decoder(bytes, header, name);
    const OIIO::ImageSpec& spec = decoder.spec;
    if (spec.nchannels > 4)
      throw Error(ErrorCode::kUnsupported, name,
                  fmt::format("the image has {} channels, expected 1 to 4", spec.nchannels));
    if (spec.format == OIIO::TypeDesc::UINT16)
      return to_unit_range(decoder.pixels<uint16_t>(OIIO::TypeDesc::UINT16, spec.nchannels, name), spec.width,
                           spec.height, spec.nchannels);
    return to_unit_range(decoder.pixels<uint8_t>(OIIO::TypeDesc::UINT8, spec.nchannels, name), spec.width,
                         spec.height, spec.nchannels);
  });
}

Image read_image(const std::filesystem::path& path, const ImageLimits& limits) {
  return decode_image(MappedFile(path).bytes(), path.string(), limits);
}

Image read_hdr(const std::filesystem::path& path, const ImageLimits& limits) {
  configure_oiio();
  const MappedFile file(path);
  const std::string name = path.string();
  const ImageHeader header = inspect_hdr(file.bytes(), name, limits);
  return decoding(name, [&] {
    Decoder decoder(file.bytes(), header, name);
    const int stored_channels = decoder.spec.nchannels;
    if (stored_channels != 1 && stored_channels < 3)
      throw Error(ErrorCode::kUnsupported, name,
                  fmt::format("an environment map needs 1, 3 or 4 channels, found {}", stored_channels));
    const int used = stored_channels == 1 ? 1 : 3;
    const std::vector<float> stored = decoder.pixels<float>(OIIO::TypeDesc::FLOAT, used, name);
    Image image(header.width, header.height, 3);
    for (size_t i = 0; i < image.num_pixels(); ++i)
      for (size_t c = 0; c < 3; ++c) {
        const float value = stored[i * static_cast<size_t>(used) + (used == 3 ? c : 0)];
        if (!std::isfinite(value))
          throw Error(
              ErrorCode::kFormat, name,
              fmt::format("pixel ({}, {}) is not a finite number; an environment map must be finite",
                          i % static_cast<size_t>(header.width), i / static_cast<size_t>(header.width)));
        image.pixels[3 * i + c] = std::max(value, 0.0f);
      }
    return image;
  });
}

std::vector<uint8_t> encode_png(const Image& image) {
  PATINA_CHECK(image.channels >= 1 && image.channels <= 4);
  return encode_8_bit(image, "png", 0);
}

void write_image(const std::filesystem::path& path, const Image& image) {
  const std::string extension = path.extension().string();
  if (extension == ".png") return write_file(path, encode_png(image));
  if (extension == ".jpg" || extension == ".jpeg") return write_file(path, encode_8_bit(image, "jpg", 92));
  if (extension == ".exr") return write_file(path, encode_exr(image));
  throw Error(ErrorCode::kUsage, path.string(), "images are written as .png, .jpg or .exr");
}

}  // namespace patina
