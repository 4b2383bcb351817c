#include <webp/decode.h>

#include <algorithm>
#include <memory>

#include <gtest/gtest.h>

#include "../support.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/report/report.h"
#include "patina/report/webp.h"
#include "pictures.h"
#include "webp_decoding.h"

namespace patina::report {
namespace {

using test::decode_animation;
using test::DecodedAnimation;
using test::from_rgba;

TEST(WebP, a_still_decodes_to_nearly_the_same_picture) {
  const Image image = test::wave_picture(75, 41, 0.4f);
  const auto bytes = encode_webp(image, 82);
  int width = 0, height = 0;
  const std::unique_ptr<uint8_t, void (*)(void*)> rgba(
      WebPDecodeRGBA(bytes.data(), bytes.size(), &width, &height), WebPFree);
  ASSERT_TRUE(rgba);
  ASSERT_EQ(width, 75);
  ASSERT_EQ(height, 41);
  EXPECT_GT(psnr(image, from_rgba(rgba.get(), width, height)), 32.0f);
  EXPECT_LT(bytes.size(), image.pixels.size() / 3);
}

TEST(WebP, values_out_of_range_and_nan_are_clamped) {
  Image image(16, 16, 3, 7.0f), white(16, 16, 3, 1.0f);
  EXPECT_EQ(encode_webp(image, 80), encode_webp(white, 80));
  std::fill(image.pixels.begin(), image.pixels.end(), std::nanf(""));
  EXPECT_EQ(encode_webp(image, 80), encode_webp(Image(16, 16, 3), 80));
}

TEST(WebP, refuses_what_the_format_cannot_hold) {
  EXPECT_THROW(encode_webp(Image(), 80), std::exception);
  EXPECT_THROW(encode_webp(Image(16384, 1, 3), 80), Error);
}

TEST(Animation, decodes_to_the_frames_that_went_in) {
  const test::TemporaryFolder folder;
  std::vector<Image> frames;
  for (int i = 0; i < 7; ++i) frames.push_back(test::wave_picture(80, 48, 0.8f * static_cast<float>(i)));
  write_animation(folder.path() / "a.webp", frames, 2.0f);

  const DecodedAnimation decoded = decode_animation(read_file(folder.path() / "a.webp"));
  ASSERT_EQ(decoded.frames.size(), frames.size());
  EXPECT_EQ(decoded.loop_count, 0u) << "endless";
  EXPECT_EQ(decoded.end_milliseconds.back(), 2000);
  for (size_t i = 0; i < frames.size(); ++i) {
    ASSERT_EQ(decoded.frames[i].width, 80);
    ASSERT_EQ(decoded.frames[i].height, 48);
    EXPECT_GT(psnr(frames[i], decoded.frames[i]), 30.0f) << "frame " << i;
    EXPECT_NEAR(decoded.end_milliseconds[i], 2000.0 * static_cast<double>(i + 1) / 7, 1.0);
  }
}

TEST(Animation, of_one_frame_is_valid_and_of_none_is_refused) {
  const std::vector<Image> one{test::wave_picture(32, 32, 0)};
  EXPECT_EQ(decode_animation(encode_webp_animation(one, 1, 80)).frames.size(), 1u);
  EXPECT_THROW(encode_webp_animation({}, 1, 80), Error);
}

TEST(Animation, refuses_frames_of_different_sizes) {
  const std::vector<Image> frames{Image(32, 32, 3), Image(32, 31, 3)};
  EXPECT_THROW(encode_webp_animation(frames, 1, 80), std::logic_error);
}

}  // namespace
}  // namespace patina::report
