// Image files: exact round trips, values as stored, and refusal of what is broken or too large.
#include "patina/image/image_io.h"

#include <zlib.h>

#include <cmath>
#include <cstring>

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/image/image_header.h"
#include "support.h"

namespace patina {
namespace {

using test::TemporaryFolder;

Image pattern(int width, int height, int channels) {
  Image image(width, height, channels);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<float>((i * 37 + i / 7) % 256) / 255.0f;
  return image;
}

void expect_equal(const Image& a, const Image& b, float tolerance = 1e-7f) {
  ASSERT_EQ(a.width, b.width);
  ASSERT_EQ(a.height, b.height);
  ASSERT_EQ(a.channels, b.channels);
  for (size_t i = 0; i < a.pixels.size(); ++i)
    ASSERT_NEAR(a.pixels[i], b.pixels[i], tolerance) << "value " << i;
}

ErrorCode refusal(std::span<const uint8_t> bytes, const ImageLimits& limits = {}) {
  try {
    decode_image(bytes, "name", limits);
  } catch (const Error& e) {
    EXPECT_EQ(e.context(), "name");
    return e.code();
  }
  ADD_FAILURE() << "was decoded";
  return ErrorCode::kUsage;
}

// A PNG chunk with its checksum.
void append_chunk(std::vector<uint8_t>& png, const char* type, const std::vector<uint8_t>& data) {
  const auto u32 = [&](size_t v) {
    for (int shift = 24; shift >= 0; shift -= 8) png.push_back(static_cast<uint8_t>(v >> shift));
  };
  u32(data.size());
  const size_t begin = png.size();
  png.insert(png.end(), type, type + 4);
  png.insert(png.end(), data.begin(), data.end());
  u32(::crc32(0, png.data() + begin, static_cast<uInt>(png.size() - begin)));
}

std::vector<uint8_t> png_of(
    uint32_t width, uint32_t height, int depth, int color, const std::vector<uint8_t>& raw,
    const std::vector<std::pair<const char*, std::vector<uint8_t>>>& before_data = {}) {
  std::vector<uint8_t> png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  std::vector<uint8_t> header;
  for (const uint32_t side : {width, height})
    for (int shift = 24; shift >= 0; shift -= 8) header.push_back(static_cast<uint8_t>(side >> shift));
  header.insert(header.end(), {static_cast<uint8_t>(depth), static_cast<uint8_t>(color), 0, 0, 0});
  append_chunk(png, "IHDR", header);
  for (const auto& [type, data] : before_data) append_chunk(png, type, data);
  std::vector<uint8_t> packed(::compressBound(raw.size()));
  uLongf size = packed.size();
  ::compress(packed.data(), &size, raw.data(), raw.size());
  packed.resize(size);
  append_chunk(png, "IDAT", packed);
  append_chunk(png, "IEND", {});
  return png;
}

TEST(Png, round_trip_is_exact_for_one_to_four_channels) {
  for (int channels = 1; channels <= 4; ++channels) {
    const Image image = pattern(17, 5, channels);
    expect_equal(decode_image(encode_png(image), "png"), image);
  }
}

TEST(Png, alpha_does_not_multiply_colour) {
  Image image(1, 1, 4);
  image.pixels = {1.0f, 0.5f, 0.25f, 0.0f};
  const Image again = decode_image(encode_png(image), "png");
  EXPECT_EQ(again.pixels[0], 1.0f);
  EXPECT_EQ(again.pixels[3], 0.0f);
}

TEST(Png, encoding_rounds_clamps_and_repeats_itself) {
  Image image(3, 1, 1);
  image.pixels = {-1.0f, 2.0f, NAN};
  const auto bytes = encode_png(image);
  EXPECT_EQ(bytes, encode_png(image));
  const Image again = decode_image(bytes, "png");
  EXPECT_EQ(again.pixels, (std::vector<float>{0.0f, 1.0f, 0.0f}));
}

TEST(Png, sixteen_bits_keep_their_precision) {
  const Image image = decode_image(png_of(2, 1, 16, 0, {0, 0x12, 0x34, 0xFF, 0xFF}), "png");
  EXPECT_FLOAT_EQ(image.pixels[0], static_cast<float>(0x1234) / 65535.0f);
  EXPECT_EQ(image.pixels[1], 1.0f);
}

TEST(Png, palettes_with_transparency_become_rgba) {
  const Image image = decode_image(
      png_of(2, 1, 8, 3, {0, 0, 1}, {{"PLTE", {255, 0, 0, 0, 51, 0}}, {"tRNS", {255, 102}}}), "png");
  ASSERT_EQ(image.channels, 4);
  EXPECT_EQ(image.pixels, (std::vector<float>{1, 0, 0, 1, 0, 51 / 255.0f, 0, 102 / 255.0f}));
}

TEST(Png, gamma_and_profiles_change_nothing) {
  const std::vector<uint8_t> raw{0, 10, 100, 200};
  const auto plain = png_of(3, 1, 8, 0, raw);
  const auto tagged =
      png_of(3, 1, 8, 0, raw,
             {{"gAMA", {0, 0, 0x27, 0x10}}, {"iCCP", {'x', 0, 0, 1, 2, 3}}, {"eXIf", {1, 2, 3, 4}}});
  expect_equal(decode_image(tagged, "png"), decode_image(plain, "png"), 0.0f);
}

TEST(Png, every_truncation_is_refused) {
  const auto bytes = encode_png(pattern(9, 9, 3));
  for (size_t length = 0; length < bytes.size(); ++length)
    EXPECT_EQ(refusal(std::span(bytes).first(length)), ErrorCode::kFormat) << length;
}

TEST(Png, sizes_are_checked_before_decoding) {
  EXPECT_EQ(refusal(png_of(16385, 1, 8, 0, {0})), ErrorCode::kLimit);
  EXPECT_EQ(refusal(png_of(16000, 16000, 8, 0, {0})), ErrorCode::kLimit);
  EXPECT_EQ(refusal(png_of(4000, 4000, 8, 2, {0})), ErrorCode::kFormat);  // more than a few bytes can hold
  EXPECT_EQ(refusal(png_of(0, 4, 8, 0, {0})), ErrorCode::kFormat);
  EXPECT_EQ(refusal(encode_png(pattern(9, 9, 3)), {8, 1000}), ErrorCode::kLimit);
  EXPECT_EQ(refusal(encode_png(pattern(9, 9, 3)), {9, 80}), ErrorCode::kLimit);
}

TEST(Jpeg, round_trip_is_close_and_every_truncation_is_refused) {
  const TemporaryFolder folder;
  Image image(32, 16, 3);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x)
      image.set_rgb(x, y, {static_cast<float>(x) / 32, static_cast<float>(y) / 16, 0.5f});
  write_image(folder.path() / "a.jpg", image);
  expect_equal(read_image(folder.path() / "a.jpg"), image, 0.06f);
  const auto bytes = read_file(folder.path() / "a.jpg");
  for (size_t length = 0; length + 1 < bytes.size(); length += 7)
    EXPECT_EQ(refusal(std::span(bytes).first(length)), ErrorCode::kFormat) << length;
}

TEST(Jpeg, application_data_is_not_parsed) {
  const TemporaryFolder folder;
  write_image(folder.path() / "a.jpg", pattern(8, 8, 3));
  auto bytes = read_file(folder.path() / "a.jpg");
  const Image plain = decode_image(bytes, "jpeg");
  const std::vector<uint8_t> exif{0xFF, 0xE1, 0x00, 0x0E, 'E',  'x',  'i',  'f',
                                  0,    0,    'M',  'M',  0xFF, 0xFF, 0xFF, 0xFF};
  bytes.insert(bytes.begin() + 2, exif.begin(), exif.end());
  expect_equal(decode_image(bytes, "jpeg"), plain, 0.0f);
}

TEST(Hdr, exr_is_written_and_read_exactly) {
  const TemporaryFolder folder;
  Image image(8, 4, 3);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = std::exp(static_cast<float>(i) * 0.15f - 4.0f);
  write_image(folder.path() / "a.exr", image);
  expect_equal(read_hdr(folder.path() / "a.exr"), image, 0.0f);
}

TEST(Hdr, exr_holds_no_date_so_that_its_bytes_repeat) {
  const TemporaryFolder folder;
  write_image(folder.path() / "a.exr", Image(4, 4, 3, 0.5f));
  const std::string bytes = read_text_file(folder.path() / "a.exr");
  const size_t date = bytes.find("capDate");
  if (date != std::string::npos) {
    EXPECT_NE(bytes.find("1970:01:01 00:00:00", date), std::string::npos);
  }
}

TEST(Hdr, real_environment_maps_have_the_stated_means) {
  struct Case {
    const char* name;
    vec3 mean;
    float largest;
  };
  for (const Case& c : {Case{"adams_place_bridge_1k.hdr", {1.42f, 1.29f, 1.16f}, 119},
                        Case{"blender_studio.exr", {0.23f, 0.26f, 0.28f}, 118}}) {
    PATINA_REQUIRE_SHARED(std::filesystem::path("assets/hdri") / c.name);
    const Image map = read_hdr(test::shared_dir() / "assets/hdri" / c.name);
    EXPECT_EQ(map.width, 1024);
    EXPECT_EQ(map.height, 512);
    double sum[3] = {};
    float largest = 0;
    for (size_t i = 0; i < map.pixels.size(); ++i)
      sum[i % 3] += map.pixels[i], largest = std::max(largest, map.pixels[i]);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(sum[k] / static_cast<double>(map.num_pixels()), c.mean[k], 0.006);
    EXPECT_NEAR(largest, c.largest, 0.6f);
  }
}

// ---- environments with layers and infinite pixels

TEST(Hdr, the_combined_layer_is_taken_whatever_stands_before_it) {
  const HdrImage hdr = read_hdr_with_notes(test::data_dir() / "cases/env/layers_ao_first.exr");
  vec3 mean(0.0f);
  for (int y = 0; y < hdr.image.height; ++y)
    for (int x = 0; x < hdr.image.width; ++x)
      mean += hdr.image.rgb(x, y) / static_cast<float>(hdr.image.num_pixels());
  EXPECT_LT(glm::length(mean - vec3(0.68f, 0.63f, 0.58f)), 0.02f);
  ASSERT_EQ(hdr.notes.size(), 1u);
  EXPECT_NE(hdr.notes[0].find("'ViewLayer.Combined' is taken"), std::string::npos);
}

TEST(Hdr, infinite_pixels_become_the_largest_finite_value) {
  const HdrImage hdr = read_hdr_with_notes(test::data_dir() / "cases/env/infinite_sun.exr");
  float largest = 0;
  for (const float value : hdr.image.pixels) {
    ASSERT_TRUE(std::isfinite(value));
    largest = std::max(largest, value);
  }
  EXPECT_EQ(largest, 65504.0f);
  EXPECT_EQ(hdr.notes.size(), 1u);

  const TemporaryFolder folder;
  Image image(2, 1, 3, 3.0f);
  image.set_rgb(1, 0,
                vec3(std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(), 1));
  write_image(folder.path() / "float.exr", image);
  EXPECT_EQ(read_hdr(folder.path() / "float.exr").rgb(1, 0), vec3(3, 0, 1));
  image.set_rgb(1, 0, vec3(std::numeric_limits<float>::quiet_NaN()));
  write_image(folder.path() / "nan.exr", image);
  EXPECT_THROW(read_hdr(folder.path() / "nan.exr"), Error);
}

// An EXR of 1 x 1 pixel; channel i holds i + 1.
std::filesystem::path exr_with(const std::filesystem::path& folder,
                               const std::vector<std::string>& channels) {
  const auto path = folder / "layers.exr";
  OIIO::ImageSpec spec(1, 1, static_cast<int>(channels.size()), OIIO::TypeDesc::FLOAT);
  spec.channelnames = channels;
  std::vector<float> values;
  for (size_t i = 0; i < channels.size(); ++i) values.push_back(static_cast<float>(i + 1));
  const auto output = OIIO::ImageOutput::create(path.string());
  EXPECT_TRUE(output && output->open(path.string(), spec) &&
              output->write_image(OIIO::TypeDesc::FLOAT, values.data()) && output->close());
  return path;
}

TEST(Hdr, layers_are_chosen_by_name_or_named) {
  const TemporaryFolder folder;
  const auto red = [&](const std::vector<std::string>& channels) {
    return read_hdr(exr_with(folder.path(), channels)).rgb(0, 0).r;
  };
  EXPECT_EQ(red({"a.R", "a.G", "a.B", "R", "G", "B"}), 4.0f);          // the plain one
  EXPECT_EQ(red({"Depth.Z", "Image.R", "Image.G", "Image.B"}), 2.0f);  // the only one with colours
  EXPECT_EQ(red({"A.Noise.R", "A.Noise.G", "A.Noise.B", "A.Combined.A", "A.Combined.B", "A.Combined.G",
                 "A.Combined.R"}),
            7.0f);
  try {
    red({"one.R", "one.G", "one.B", "two.R", "two.G", "two.B"});
    ADD_FAILURE() << "was read";
  } catch (const Error& e) {
    EXPECT_NE(e.message().find("'one', 'two'"), std::string::npos) << e.message();
  }
  EXPECT_THROW(red({"U", "V"}), Error);
  // A render with many passes.
  std::vector<std::string> many{"R", "G", "B"};
  for (int i = 0; i < 100; ++i) many.push_back("pass" + std::to_string(i) + ".V");
  EXPECT_EQ(red(many), 1.0f);
}

TEST(Files, mime_types_are_told_by_content) {
  const auto type = [](std::string_view bytes) {
    return mime_type({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()});
  };
  using namespace std::string_view_literals;
  EXPECT_EQ(type("RIFF\1\0\0\0WEBPVP8 "sv), "image/webp");
  EXPECT_EQ(type("\xABKTX 20\xBB\r\n\x1A\n"sv), "image/ktx2");
  EXPECT_EQ(type("\0\0\0\x1C\x66typavif\0\0\0\0"sv), "image/avif");
  EXPECT_EQ(type("\0\0\0\x20\x66typmif1\0\0\0\0mif1avifmiaf"sv), "image/avif");
  EXPECT_EQ(type("DDS |\0\0\0"sv), "image/vnd-ms.dds");
  EXPECT_EQ(type("RIFF\1\0\0\0WAVEfmt "sv), "");
  EXPECT_EQ(type("GIF89a"sv), "");
  EXPECT_EQ(type(""sv), "");
}

TEST(Files, formats_are_told_by_content_and_errors_name_the_file) {
  const TemporaryFolder folder;
  write_file(folder.path() / "page.png", std::string_view("<html>not here</html>"));
  write_file(folder.path() / "really.jpg", std::span<const uint8_t>(encode_png(pattern(2, 2, 3))));
  EXPECT_EQ(read_image(folder.path() / "really.jpg").width, 2);
  for (const char* name : {"page.png", "absent.png"}) {
    try {
      read_image(folder.path() / name);
      ADD_FAILURE() << name;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(name), std::string::npos);
    }
  }
  EXPECT_THROW(write_image(folder.path() / "a.gif", pattern(2, 2, 3)), Error);
}

}  // namespace
}  // namespace patina
