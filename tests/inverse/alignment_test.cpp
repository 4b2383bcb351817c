// Displacements of views against known ones.
#include "patina/inverse/alignment.h"

#include <cmath>
#include <functional>

#include "patina/base/math.h"
#include "support.h"

namespace patina::inverse {
namespace {

constexpr int kSide = 192;

// Waves of several lengths and directions, different in each channel: detail that no interpolation hurts.
vec3 pattern(vec2 p) {
  vec3 out(0.5f);
  for (int i = 0; i < 9; ++i) {
    const float angle = 2.4f * static_cast<float>(i), length = 7.0f + 4.0f * static_cast<float>(i);
    const float phase = 2 * kPi / length * (std::cos(angle) * p.x + std::sin(angle) * p.y);
    for (int c = 0; c < 3; ++c) out[c] += 0.05f * std::sin(phase + static_cast<float>(i * (c + 1)));
  }
  return out;
}

Image picture(const std::function<vec3(vec2)>& color) {
  Image out(kSide, kSide, 3);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) out.set_rgb(x, y, color({static_cast<float>(x), static_cast<float>(y)}));
  return out;
}

Image filled(float value) {
  Image out(kSide, kSide, 1);
  std::fill(out.pixels.begin(), out.pixels.end(), value);
  return out;
}

// Root mean square difference of `image` from the pattern, away from the border that displacements bring in.
float error(const Image& image) {
  float sum = 0, count = 0;
  for (int y = 12; y < kSide - 12; ++y)
    for (int x = 12; x < kSide - 12; ++x, count += 3) {
      const vec3 d = image.rgb(x, y) - pattern({static_cast<float>(x), static_cast<float>(y)});
      sum += glm::dot(d, d);
    }
  return std::sqrt(sum / count);
}

Image aligned(const Image& rendered, const Image& edited, const Image& weight) {
  const Image d = estimate_displacement(rendered, edited, weight, no_displacement(kSide, kSide));
  return displaced(edited, d);
}

TEST(Alignment, views_that_agree_stay_bit_for_bit) {
  const Image view = picture(pattern);
  EXPECT_EQ(aligned(view, view, filled(1)).pixels, view.pixels);
}

TEST(Alignment, undoes_a_shift_and_a_smooth_bend) {
  const Image truth = picture(pattern);
  for (const float shift : {1.0f, 2.5f, 5.0f}) {
    const Image shifted = picture([&](vec2 p) { return pattern(p - vec2(shift, -0.6f * shift)); });
    EXPECT_LT(error(aligned(truth, shifted, filled(1))), 0.1f * error(shifted)) << shift;
  }
  const Image bent =
      picture([](vec2 p) { return pattern(p + vec2(2.0f * std::sin(p.y / 40), 1.5f * std::cos(p.x / 50))); });
  EXPECT_LT(error(aligned(truth, bent, filled(1))), 0.3f * error(bent));
}

TEST(Alignment, bears_a_noisy_render_and_pixels_that_do_not_count) {
  Image rendered = picture(pattern);
  Image weight = filled(1);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const float noise = 0.2f * (static_cast<float>((x * 7919 + y * 104729) % 1009) / 1008.0f - 0.5f);
      rendered.set_rgb(x, y, rendered.rgb(x, y) + noise);
      if (x > 120) *weight.at(x, y) = 0, rendered.set_rgb(x, y, vec3(0.0f));
    }
  const Image shifted = picture([](vec2 p) { return pattern(p - vec2(3, 2)); });
  EXPECT_LT(error(aligned(rendered, shifted, weight)), 0.2f * error(shifted));
}

TEST(Alignment, a_view_without_detail_stays) {
  const Image plain = picture([](vec2) { return vec3(0.4f); });
  const Image other = picture([](vec2 p) { return vec3(0.4f + 0.1f * std::sin(p.x / 9)); });
  EXPECT_EQ(aligned(other, plain, filled(1)).pixels, plain.pixels);
  EXPECT_EQ(aligned(plain, other, filled(0)).pixels, other.pixels);
}

}  // namespace
}  // namespace patina::inverse
