#include <cmath>

#include <gtest/gtest.h>

#include "patina/report/report.h"
#include "pictures.h"

namespace patina::report {
namespace {

using test::noise_picture;
using test::wave_picture;

// A box blur over (2r+1)² pixels, clamped at the border.
Image box_blurred(const Image& image, int r) {
  Image out(image.width, image.height, 3);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      vec3 sum(0.0f);
      for (int v = -r; v <= r; ++v)
        for (int u = -r; u <= r; ++u)
          sum += image.rgb(std::clamp(x + u, 0, image.width - 1), std::clamp(y + v, 0, image.height - 1));
      out.set_rgb(x, y, sum / static_cast<float>((2 * r + 1) * (2 * r + 1)));
    }
  return out;
}

Image disc_mask(int side) {
  Image mask(side, side, 1);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      if (std::hypot(x - side / 2, y - side / 2) < 0.35 * side) *mask.at(x, y) = 1;
  return mask;
}

TEST(Psnr, of_a_constant_offset_is_minus_twenty_log10_of_it) {
  Image a = wave_picture(40, 30, 0), b = a;
  for (float& value : b.pixels) value += 0.1f;
  EXPECT_NEAR(psnr(a, b), 20.0f, 1e-3f);
}

TEST(Psnr, is_infinite_for_equal_pictures_and_nan_without_weight) {
  const Image a = noise_picture(8, 8, 1);
  EXPECT_TRUE(std::isinf(psnr(a, a)));
  EXPECT_TRUE(std::isnan(psnr(a, a, Image(8, 8, 1))));
}

TEST(Psnr, counts_only_what_the_mask_weighs) {
  const Image a = wave_picture(64, 64, 0), mask = disc_mask(64);
  Image b = a;
  for (size_t i = 0; i < b.num_pixels(); ++i)
    for (size_t c = 0; c < 3; ++c) b.pixels[3 * i + c] += mask.pixels[i] > 0 ? 0.01f : 0.5f;
  EXPECT_NEAR(psnr(a, b, mask), 40.0f, 1e-2f);
  EXPECT_LT(psnr(a, b), 15.0f);
}

TEST(Psnr, refuses_pictures_of_different_sizes) {
  EXPECT_THROW(psnr(Image(4, 4, 3), Image(4, 5, 3)), std::logic_error);
  EXPECT_THROW(psnr(Image(4, 4, 3), Image(4, 4, 3), Image(3, 4, 1)), std::logic_error);
}

TEST(SharpnessKept, is_one_for_the_picture_itself_and_falls_with_every_blur) {
  const Image sharp = noise_picture(96, 96, 3), mask = disc_mask(96);
  EXPECT_FLOAT_EQ(sharpness_kept(sharp, sharp, mask), 1.0f);
  const float slightly = sharpness_kept(box_blurred(sharp, 1), sharp, mask);
  const float strongly = sharpness_kept(box_blurred(sharp, 3), sharp, mask);
  EXPECT_LT(slightly, 0.1f);
  EXPECT_LT(strongly, 0.5f * slightly);
  EXPECT_GT(strongly, 0.0f);
}

TEST(SharpnessKept, is_energy_so_half_the_contrast_leaves_a_quarter) {
  const Image sharp = noise_picture(96, 96, 4);
  Image half = sharp;
  for (float& value : half.pixels) value = 0.5f + 0.5f * (value - 0.5f);
  EXPECT_NEAR(sharpness_kept(half, sharp, {}), 0.25f, 0.001f);
}

TEST(SharpnessKept, does_not_see_colour_offsets_or_slow_gradients) {
  const Image sharp = noise_picture(96, 96, 5);
  Image shaded = sharp;
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 96; ++x)
      shaded.set_rgb(x, y, sharp.rgb(x, y) + vec3(0.1f, 0.002f * static_cast<float>(x), 0.0f));
  EXPECT_NEAR(sharpness_kept(shaded, sharp, {}), 1.0f, 0.01f);
}

TEST(SharpnessKept, does_not_count_the_silhouette) {
  // Outside of the mask one picture is black and the other white; inside both are equally flat.
  const Image mask = disc_mask(96);
  Image dark(96, 96, 3, 0.4f), bright = dark;
  for (size_t i = 0; i < mask.num_pixels(); ++i)
    for (size_t c = 0; c < 3; ++c)
      if (mask.pixels[i] == 0) dark.pixels[3 * i + c] = 0, bright.pixels[3 * i + c] = 1;
  EXPECT_NEAR(sharpness_kept(dark, bright, mask), 1.0f, 1e-3f);
  Image detailed = dark;
  const Image noise = noise_picture(96, 96, 6);
  for (size_t i = 0; i < detailed.pixels.size(); ++i) detailed.pixels[i] += 0.1f * noise.pixels[i];
  EXPECT_GT(sharpness_kept(detailed, bright, mask), 50.0f) << "detail where the reference has none";
}

TEST(SharpnessKept, passes_fine_detail_and_stops_coarse_detail) {
  // Response 1 − exp(−2π²f²) of the amplitude: 0.99 at wavelength 2, 0.04 at wavelength 22.
  const Image flat(132, 132, 3, 0.5f);
  const auto energy = [&](float wavelength) {
    return sharpness_kept(wave_picture(132, 132, 0.3f, wavelength), flat, {});
  };
  EXPECT_GT(energy(3), 100 * energy(22));
}

TEST(SharpnessKept, is_nan_without_weight) {
  const Image a = noise_picture(8, 8, 7);
  EXPECT_TRUE(std::isnan(sharpness_kept(a, a, Image(8, 8, 1))));
}

}  // namespace
}  // namespace patina::report
