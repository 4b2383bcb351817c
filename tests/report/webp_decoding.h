// Decodes animated WebP with libwebp's own decoder.
#pragma once

#include <webp/demux.h>

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <vector>

#include "patina/image/image.h"

namespace patina::test {

inline Image from_rgba(const uint8_t* rgba, int width, int height) {
  Image image(width, height, 3);
  for (size_t i = 0; i < image.num_pixels(); ++i)
    for (size_t c = 0; c < 3; ++c) image.pixels[3 * i + c] = static_cast<float>(rgba[4 * i + c]) / 255.0f;
  return image;
}

struct DecodedAnimation {
  std::vector<Image> frames;
  std::vector<int> end_milliseconds;
  uint32_t loop_count = 1;
};

inline DecodedAnimation decode_animation(const std::vector<uint8_t>& bytes) {
  const WebPData data{bytes.data(), bytes.size()};
  const std::unique_ptr<WebPAnimDecoder, void (*)(WebPAnimDecoder*)> decoder(
      WebPAnimDecoderNew(&data, nullptr), WebPAnimDecoderDelete);
  WebPAnimInfo info;
  if (!decoder || !WebPAnimDecoderGetInfo(decoder.get(), &info))
    throw std::runtime_error("not an animated WebP");
  DecodedAnimation out;
  out.loop_count = info.loop_count;
  while (WebPAnimDecoderHasMoreFrames(decoder.get())) {
    uint8_t* rgba = nullptr;
    int end = 0;
    if (!WebPAnimDecoderGetNext(decoder.get(), &rgba, &end)) throw std::runtime_error("a frame is broken");
    out.frames.push_back(
        from_rgba(rgba, static_cast<int>(info.canvas_width), static_cast<int>(info.canvas_height)));
    out.end_milliseconds.push_back(end);
  }
  return out;
}

}  // namespace patina::test
