#include "patina/image/image_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
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
    OIIO::attribute("limits:channels", 1024);  // a render with many passes
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

  // One channel of all pixels.
  std::vector<float> plane(int channel, const std::string& name) {
    std::vector<float> out(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height));
    if (!input->read_image(0, 0, channel, channel + 1, OIIO::TypeDesc::FLOAT, out.data()))
      throw Error(ErrorCode::kFormat, name, "the image cannot be decoded: " + last_error(input->geterror()));
    return out;
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

// ---- layers and values of environments
// --------------------------------------------------------------------------------

// Which channels of a file are red, green and blue.
struct ChannelChoice {
  std::array<int, 3> channels;
  std::string note;
};

// A layer: what stands before the last dot of its channels' names.
struct Layer {
  std::string name;
  std::array<int, 3> rgb{-1, -1, -1};
  bool is_color() const { return rgb[0] >= 0 && rgb[1] >= 0 && rgb[2] >= 0; }
};

std::vector<Layer> color_layers(const std::vector<std::string>& channels) {
  constexpr std::array<std::array<std::string_view, 2>, 3> kNames = {
      {{"r", "red"}, {"g", "green"}, {"b", "blue"}}};
  std::vector<Layer> layers;
  for (size_t i = 0; i < channels.size(); ++i) {
    const size_t dot = channels[i].rfind('.');
    const std::string prefix = dot == std::string::npos ? "" : channels[i].substr(0, dot);
    const std::string channel = lowered(channels[i].substr(dot == std::string::npos ? 0 : dot + 1));
    auto layer = std::find_if(layers.begin(), layers.end(), [&](const Layer& l) { return l.name == prefix; });
    if (layer == layers.end()) layer = layers.insert(layers.end(), Layer{prefix});
    for (size_t c = 0; c < 3; ++c)
      if (channel == kNames[c][0] || channel == kNames[c][1]) layer->rgb[c] = static_cast<int>(i);
  }
  std::erase_if(layers, [](const Layer& l) { return !l.is_color(); });
  return layers;
}

// How renderers call the layer that is the picture.
bool is_picture(const Layer& layer) {
  const std::string last = lowered(layer.name.substr(layer.name.rfind('.') + 1));
  return last == "combined" || last == "beauty" || last == "rgba" || last == "rgb" || last == "composite";
}

ChannelChoice choose_channels(const std::vector<std::string>& channels, const std::string& name) {
  if (channels.size() == 1) return {{0, 0, 0}, ""};
  const std::vector<Layer> layers = color_layers(channels);
  std::string names;
  for (const Layer& layer : layers)
    names += fmt::format("{}'{}'", names.empty() ? "" : ", ", printable(layer.name, 60));
  if (layers.empty()) {
    for (const std::string& channel : channels)
      if (names.size() < 200) names += (names.empty() ? "" : ", ") + printable(channel, 60);
    throw Error(ErrorCode::kUnsupported, name,
                fmt::format("an environment map needs channels R, G and B or a single one, found {}", names));
  }
  const auto plain =
      std::find_if(layers.begin(), layers.end(), [](const Layer& l) { return l.name.empty(); });
  if (plain != layers.end()) return {plain->rgb, ""};
  if (layers.size() == 1) return {layers[0].rgb, ""};
  const auto picture = std::find_if(layers.begin(), layers.end(), is_picture);
  if (picture == layers.end())
    throw Error(ErrorCode::kUnsupported, name,
                fmt::format("the EXR file has the layers {} and none called Combined; save the one that "
                            "shall light the asset as a file of its own",
                            names));
  return {picture->rgb,
          fmt::format("{}: of its layers {}, '{}' is taken", name, names, printable(picture->name, 60))};
}

constexpr float kLargestHalf = 65504.0f;

// Brings infinite values to `largest` (0: to the largest finite value of the image) and negative ones to
// zero.
void make_finite(HdrImage& hdr, float largest, const std::string& name) {
  std::vector<float>& pixels = hdr.image.pixels;
  const auto width = static_cast<size_t>(hdr.image.width);
  if (largest == 0.0f)
    for (const float value : pixels)
      if (std::isfinite(value)) largest = std::max(largest, value);
  size_t num_infinite = 0, last_infinite = SIZE_MAX;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t pixel = i / 3;
    if (std::isnan(pixels[i]))
      throw Error(ErrorCode::kFormat, name,
                  fmt::format("pixel ({}, {}) is not a number; an environment map must be finite",
                              pixel % width, pixel / width));
    if (std::isinf(pixels[i]) && pixel != last_infinite) {
      ++num_infinite;
      last_infinite = pixel;
    }
    pixels[i] = std::isinf(pixels[i]) ? (pixels[i] > 0 ? largest : 0.0f) : std::max(pixels[i], 0.0f);
  }
  if (num_infinite > 0)
    hdr.notes.push_back(
        fmt::format("{}: {} pixel(s) are infinite and are brought to the largest finite value, {}", name,
                    num_infinite, largest));
}

// Encodes through OpenImageIO into memory.
std::vector<uint8_t> encode(const Image& image, const char* format, const OIIO::ImageSpec& spec,
                            const OIIO::TypeDesc& type, const void* pixels) {
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
    return !(v > 0.0f) ? uint8_t{0} : static_cast<uint8_t>(std::lround(std::min(v, 1.0f) * 255.0f));
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
  spec.attribute("DateTime", "1970:01:01 00:00:00");  // else that of today, and bytes would not repeat
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

HdrImage read_hdr_with_notes(const std::filesystem::path& path, const ImageLimits& limits) {
  configure_oiio();
  const MappedFile file(path);
  const std::string name = path.string();
  const ImageHeader header = inspect_hdr(file.bytes(), name, limits);
  return decoding(name, [&] {
    Decoder decoder(file.bytes(), header, name);
    const ChannelChoice choice = choose_channels(decoder.spec.channelnames, name);
    HdrImage out;
    if (!choice.note.empty()) out.notes.push_back(choice.note);
    out.image = Image(header.width, header.height, 3);
    for (size_t c = 0; c < 3; ++c) {
      const std::vector<float> plane = decoder.plane(choice.channels[c], name);
      for (size_t i = 0; i < plane.size(); ++i) out.image.pixels[3 * i + c] = plane[i];
    }
    const bool is_half = decoder.spec.format == OIIO::TypeDesc::HALF;
    make_finite(out, is_half ? kLargestHalf : 0.0f, name);
    return out;
  });
}

Image read_hdr(const std::filesystem::path& path, const ImageLimits& limits) {
  return read_hdr_with_notes(path, limits).image;
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
