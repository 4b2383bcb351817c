#include "patina/report/webp.h"

#include <webp/encode.h>
#include <webp/mux.h>

#include <cmath>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/report/report.h"

namespace patina::report {
namespace {

[[noreturn]] void throw_webp(const std::string& what) {
  throw Error(ErrorCode::kIo, "WebP", what);
}

WebPConfig make_config(float quality) {
  WebPConfig config;
  if (!WebPConfigInit(&config))
    throw_webp("the installed libwebp has another interface than the one built against");
  config.quality = quality;
  config.use_sharp_yuv =
      1;  // plain 4:2:0 darkens and smears thin coloured detail, which is what these pictures are about
  return config;
}

// A WebPPicture and its memory.
class Picture {
 public:
  explicit Picture(const Image& image) {
    PATINA_CHECK_EQ(image.channels, 3);
    if (image.empty() || image.width > WEBP_MAX_DIMENSION || image.height > WEBP_MAX_DIMENSION)
      throw Error(ErrorCode::kUsage, "WebP",
                  fmt::format("cannot hold {} x {} pixels, only 1 to {} a side", image.width, image.height,
                              WEBP_MAX_DIMENSION));
    if (!WebPPictureInit(&picture_))
      throw_webp("the installed libwebp has another interface than the one built against");
    picture_.use_argb = 1;
    picture_.width = image.width;
    picture_.height = image.height;
    std::vector<uint8_t> bytes(image.pixels.size());
    for (size_t i = 0; i < bytes.size(); ++i) {
      // Written so that NaN becomes 0 too.
      const float value = image.pixels[i] > 0 ? std::min(image.pixels[i], 1.0f) : 0.0f;
      bytes[i] = static_cast<uint8_t>(std::lround(255.0f * value));
    }
    if (!WebPPictureImportRGB(&picture_, bytes.data(), 3 * image.width)) throw_webp("out of memory");
  }
  ~Picture() { WebPPictureFree(&picture_); }
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;
  WebPPicture* get() { return &picture_; }

 private:
  WebPPicture picture_;
};

}  // namespace

std::vector<uint8_t> encode_webp(const Image& image, float quality) {
  const WebPConfig config = make_config(quality);
  Picture picture(image);
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  const std::unique_ptr<WebPMemoryWriter, void (*)(WebPMemoryWriter*)> free_later(&writer,
                                                                                  WebPMemoryWriterClear);
  picture.get()->writer = WebPMemoryWrite;
  picture.get()->custom_ptr = &writer;
  if (!WebPEncode(&config, picture.get()))
    throw_webp(
        fmt::format("encoding failed with libwebp's error {}", static_cast<int>(picture.get()->error_code)));
  return {writer.mem, writer.mem + writer.size};
}

std::vector<uint8_t> encode_webp_animation(std::span<const Image> frames, float seconds, float quality) {
  if (frames.empty()) throw Error(ErrorCode::kUsage, "WebP", "an animation needs at least one frame");
  PATINA_CHECK(seconds > 0);
  WebPAnimEncoderOptions options;
  if (!WebPAnimEncoderOptionsInit(&options))
    throw_webp("the installed libwebp has another interface than the one built against");
  options.anim_params.loop_count = 0;  // endless
  const std::unique_ptr<WebPAnimEncoder, void (*)(WebPAnimEncoder*)> encoder(
      WebPAnimEncoderNew(frames[0].width, frames[0].height, &options), WebPAnimEncoderDelete);
  if (!encoder)
    throw_webp(fmt::format("cannot hold an animation of {} x {} pixels", frames[0].width, frames[0].height));

  // Time stamps are when a frame begins, in whole milliseconds from the exact time, so that rounding does not
  // add up.
  const WebPConfig config = make_config(quality);
  const auto milliseconds = [&](size_t i) {
    return static_cast<int>(
        std::lround(1000.0 * seconds * static_cast<double>(i) / static_cast<double>(frames.size())));
  };
  for (size_t i = 0; i < frames.size(); ++i) {
    PATINA_CHECK_EQ(frames[i].width, frames[0].width);
    PATINA_CHECK_EQ(frames[i].height, frames[0].height);
    Picture picture(frames[i]);
    if (!WebPAnimEncoderAdd(encoder.get(), picture.get(), milliseconds(i), &config))
      throw_webp(WebPAnimEncoderGetError(encoder.get()));
  }
  if (!WebPAnimEncoderAdd(encoder.get(), nullptr, milliseconds(frames.size()), nullptr))
    throw_webp(WebPAnimEncoderGetError(encoder.get()));

  WebPData data;
  WebPDataInit(&data);
  const std::unique_ptr<WebPData, void (*)(WebPData*)> free_later(&data, WebPDataClear);
  if (!WebPAnimEncoderAssemble(encoder.get(), &data)) throw_webp(WebPAnimEncoderGetError(encoder.get()));
  return {data.bytes, data.bytes + data.size};
}

void write_animation(const std::filesystem::path& path, std::span<const Image> frames, float seconds) {
  constexpr float kQuality = 80;
  const auto bytes = encode_webp_animation(frames, seconds, kQuality);
  write_file(path, std::span<const uint8_t>(bytes));
}

}  // namespace patina::report
