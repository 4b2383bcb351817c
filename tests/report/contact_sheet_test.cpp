#include <cmath>

#include <gtest/gtest.h>

#include "patina/image/color.h"
#include "patina/report/report.h"
#include "patina/report/scale.h"
#include "pictures.h"

namespace patina::report {
namespace {

double mean(const Image& image) {
  double sum = 0;
  for (const float value : image.pixels) sum += value;
  return sum / static_cast<double>(image.pixels.size());
}

TEST(Scaled, keeps_the_mean_when_shrinking_by_any_factor) {
  const Image image = test::noise_picture(97, 61, 1);
  for (const auto& [width, height] : {std::pair{96, 60}, {48, 31}, {13, 7}, {1, 1}, {97, 1}})
    EXPECT_NEAR(mean(scaled(image, width, height)), mean(image), 1e-5) << width << " x " << height;
}

TEST(Scaled, halving_is_the_mean_of_four_pixels) {
  const Image image = test::noise_picture(8, 6, 2), half = scaled(image, 4, 3);
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 4; ++x)
      for (int c = 0; c < 3; ++c) {
        const float expected = 0.25f * (image.at(2 * x, 2 * y)[c] + image.at(2 * x + 1, 2 * y)[c] +
                                        image.at(2 * x, 2 * y + 1)[c] + image.at(2 * x + 1, 2 * y + 1)[c]);
        EXPECT_NEAR(half.at(x, y)[c], expected, 1e-6f);
      }
}

TEST(Scaled, enlarging_reproduces_a_ramp_between_the_outer_centres) {
  Image ramp(4, 1, 1);
  for (int x = 0; x < 4; ++x) ramp.at(x, 0)[0] = static_cast<float>(x) + 0.5f;
  const Image large = scaled(ramp, 16, 3);
  for (int x = 2; x < 14; ++x) EXPECT_NEAR(large.at(x, 1)[0], (static_cast<float>(x) + 0.5f) / 4, 1e-6f);
  EXPECT_FLOAT_EQ(large.at(0, 0)[0], 0.5f);
  EXPECT_FLOAT_EQ(large.at(15, 2)[0], 3.5f);
}

TEST(Scaled, srgb_is_averaged_in_linear_light) {
  Image checker(2, 1, 3);
  checker.set_rgb(1, 0, vec3(1.0f));
  EXPECT_NEAR(scaled_srgb(checker, 1, 1).at(0, 0)[0], srgb_from_linear(0.5f), 1e-6f);
}

TEST(ContactSheet, places_tiles_row_by_row_on_a_neutral_ground) {
  std::vector<Image> images;
  for (int i = 0; i < 5; ++i) images.emplace_back(64, 64, 3, 0.1f * static_cast<float>(i));
  const Image sheet = contact_sheet(images, 3, 32);
  const int gap = (sheet.width - 3 * 32) / 4;
  EXPECT_EQ(sheet.width, 3 * 32 + 4 * gap);
  EXPECT_EQ(sheet.height, 2 * 32 + 3 * gap);
  for (int i = 0; i < 5; ++i) {
    const int x = gap + (i % 3) * (32 + gap) + 16, y = gap + (i / 3) * (32 + gap) + 16;
    EXPECT_NEAR(sheet.at(x, y)[0], 0.1f * static_cast<float>(i), 1e-5f) << i;
  }
  EXPECT_FLOAT_EQ(sheet.at(0, 0)[1], 0.5f);
  EXPECT_FLOAT_EQ(sheet.at(sheet.width - 1, sheet.height - 1)[1], 0.5f);
  EXPECT_FLOAT_EQ(sheet.at(sheet.width - gap - 16, sheet.height - gap - 16)[1], 0.5f)
      << "the empty sixth place";
}

TEST(ContactSheet, keeps_the_shape_of_unequal_pictures_and_shows_grey_ones) {
  const std::vector<Image> images{Image(100, 50, 1, 0.25f), Image(50, 100, 4, 0.75f)};
  const Image sheet = contact_sheet(images, 2, 40);
  const int gap = (sheet.width - 80) / 3;
  EXPECT_EQ(sheet.height, 80 + 2 * gap);
  EXPECT_NEAR(sheet.at(gap + 5, gap + 10)[2], 0.25f, 1e-5f);
  EXPECT_FLOAT_EQ(sheet.at(gap + 5, gap + 30)[2], 0.5f) << "below the flat picture";
  EXPECT_NEAR(sheet.at(2 * gap + 45, gap + 70)[2], 0.75f, 1e-5f);
}

}  // namespace
}  // namespace patina::report
