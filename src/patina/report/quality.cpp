// Two numbers that say how well one picture stands for another: PSNR, and the share of fine detail that is
// left.
#include <array>
#include <cmath>
#include <limits>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/report/report.h"

namespace patina::report {
namespace {

void check_same_size(const Image& a, const Image& b, const Image& mask) {
  PATINA_CHECK_EQ(a.width, b.width);
  PATINA_CHECK_EQ(a.height, b.height);
  PATINA_CHECK_EQ(a.channels, b.channels);
  if (mask.empty()) return;
  PATINA_CHECK_EQ(mask.width, a.width);
  PATINA_CHECK_EQ(mask.height, a.height);
  PATINA_CHECK_EQ(mask.channels, 1);
}

float weight_at(const Image& mask, size_t pixel) {
  return mask.empty() ? 1.0f : mask.pixels[pixel];
}

// Normalised taps of a Gaussian with a standard deviation of one pixel; the tail beyond 4 σ is below 1e-4.
constexpr int kRadius = 4;
std::array<float, 2 * kRadius + 1> gaussian_taps() {
  std::array<float, 2 * kRadius + 1> taps;
  float sum = 0;
  for (int k = -kRadius; k <= kRadius; ++k)
    sum += taps[static_cast<size_t>(k + kRadius)] = std::exp(-0.5f * static_cast<float>(k * k));
  for (float& tap : taps) tap /= sum;
  return taps;
}

// One direction of the blur of a [H,W,2] image; what lies outside counts as zero in both channels.
Image blurred(const Image& image, int step_x, int step_y) {
  const auto taps = gaussian_taps();
  Image out(image.width, image.height, 2);
  parallel_for(0, image.height, 16, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < image.width; ++x)
        for (int k = -kRadius; k <= kRadius; ++k) {
          const int sx = x + k * step_x, sy = y + k * step_y;
          if (sx < 0 || sy < 0 || sx >= image.width || sy >= image.height) continue;
          const float tap = taps[static_cast<size_t>(k + kRadius)];
          out.at(x, y)[0] += tap * image.at(sx, sy)[0];
          out.at(x, y)[1] += tap * image.at(sx, sy)[1];
        }
  });
  return out;
}

// Mask-weighted sum of (Y − blur(Y))². The blur is normalised by the blurred mask, so that the silhouette,
// where the mask ends, is no detail: pixels beyond it have no say.
double high_frequency_energy(const Image& image, const Image& mask) {
  Image weighted(image.width, image.height, 2);  // (m·Y, m)
  for (size_t i = 0; i < image.num_pixels(); ++i) {
    const float* rgb = &image.pixels[3 * i];
    const float m = weight_at(mask, i);
    weighted.pixels[2 * i] = m > 0 ? m * luminance({rgb[0], rgb[1], rgb[2]}) : 0.0f;
    weighted.pixels[2 * i + 1] = m;
  }
  const Image smooth = blurred(blurred(weighted, 1, 0), 0, 1);
  double energy = 0;
  for (size_t i = 0; i < image.num_pixels(); ++i) {
    const float m = weighted.pixels[2 * i + 1];
    if (m <= 0) continue;
    const float detail = weighted.pixels[2 * i] / m - smooth.pixels[2 * i] / smooth.pixels[2 * i + 1];
    energy += static_cast<double>(m) * detail * detail;
  }
  return energy;
}

}  // namespace

float sharpness_kept(const Image& image, const Image& reference, const Image& mask) {
  check_same_size(image, reference, mask);
  PATINA_CHECK_EQ(image.channels, 3);
  double total = 0;
  for (size_t i = 0; i < image.num_pixels(); ++i) total += weight_at(mask, i);
  if (!(total > 0)) return std::numeric_limits<float>::quiet_NaN();

  // Rounding to 8 bits alone makes this energy; on both sides it keeps the ratio of two flat pictures at one.
  constexpr double kQuantisation = 1.0 / (255.0 * 255.0 * 12.0);
  return static_cast<float>((high_frequency_energy(image, mask) + total * kQuantisation) /
                            (high_frequency_energy(reference, mask) + total * kQuantisation));
}

float psnr(const Image& a, const Image& b, const Image& mask) {
  check_same_size(a, b, mask);
  const auto channels = static_cast<size_t>(a.channels);
  double error = 0, total = 0;
  for (size_t i = 0; i < a.num_pixels(); ++i) {
    const double m = weight_at(mask, i);
    if (!(m > 0)) continue;
    for (size_t c = 0; c < channels; ++c) {
      const double difference = static_cast<double>(a.pixels[i * channels + c]) - b.pixels[i * channels + c];
      error += m * difference * difference;
    }
    total += m * static_cast<double>(channels);
  }
  if (!(total > 0)) return std::numeric_limits<float>::quiet_NaN();
  if (error == 0) return std::numeric_limits<float>::infinity();
  return static_cast<float>(10.0 * std::log10(total / error));
}

}  // namespace patina::report
