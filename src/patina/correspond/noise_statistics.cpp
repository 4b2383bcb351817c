// Whiteness of the noise: moments, lag-1 autocorrelation and the Kolmogorov-Smirnov test against N(0,1), view
// by view.
#include <algorithm>
#include <string>

#include "patina/base/error.h"
#include "patina/correspond/noise.h"
#include "patina/correspond/noise_projection.h"

namespace patina::correspond {
namespace {

// Probability that the Kolmogorov-Smirnov statistic of n numbers exceeds d, by the asymptotic series with
// Stephens' correction for finite n [Stephens1970].
double kolmogorov_smirnov_p(double d, double n) {
  const double lambda = (std::sqrt(n) + 0.12 + 0.11 / std::sqrt(n)) * d;
  if (lambda < 0.2) return 1.0;  // the series converges too slowly there, and its sum is 1 to fifteen digits
  double sum = 0;
  for (int k = 1; k <= 100; ++k) {
    const double term = std::exp(-2.0 * k * k * lambda * lambda);
    sum += k % 2 == 1 ? term : -term;
    if (term < 1e-12) break;
  }
  return std::clamp(2.0 * sum, 0.0, 1.0);
}

double distance_to_standard_normal(std::vector<float> values) {
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  double distance = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    const double cdf = 0.5 * std::erfc(-static_cast<double>(values[i]) / std::numbers::sqrt2);
    distance = std::max({distance, cdf - static_cast<double>(i) / n, static_cast<double>(i + 1) / n - cdf});
  }
  return distance;
}

// One view of the grid, seen through the mask.
struct Window {
  const NoiseField& noise;
  std::span<const uint8_t> mask;
  int x0, y0, width, height;

  size_t pixel(int x, int y) const {
    return static_cast<size_t>(y0 + y) * static_cast<size_t>(noise.width) + static_cast<size_t>(x0 + x);
  }
  bool counts(int x, int y) const { return x < width && y < height && (mask.empty() || mask[pixel(x, y)]); }
  float value(int channel, int x, int y) const {
    return noise.values[static_cast<size_t>(channel) * static_cast<size_t>(noise.width) *
                            static_cast<size_t>(noise.height) +
                        pixel(x, y)];
  }
  template <class F>
  void each_value(const F& f) const {
    for (int channel = 0; channel < kNoiseChannels; ++channel)
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          if (counts(x, y)) f(channel, x, y);
  }
};

NoiseStatistics statistics_of(const Window& view) {
  std::vector<float> values;
  double sum = 0, sum_of_squares = 0;
  view.each_value([&](int channel, int x, int y) {
    values.push_back(view.value(channel, x, y));
    sum += values.back();
    sum_of_squares += static_cast<double>(values.back()) * values.back();
  });
  NoiseStatistics out;
  out.num_values = static_cast<int64_t>(values.size());
  if (values.empty()) return out;
  const auto count = static_cast<double>(values.size());
  const double mean = sum / count;
  const double variance = sum_of_squares / count - mean * mean;
  double along_x = 0, along_y = 0, num_x = 0, num_y = 0;
  view.each_value([&](int channel, int x, int y) {
    const double here = view.value(channel, x, y) - mean;
    if (view.counts(x + 1, y)) along_x += here * (view.value(channel, x + 1, y) - mean), ++num_x;
    if (view.counts(x, y + 1)) along_y += here * (view.value(channel, x, y + 1) - mean), ++num_y;
  });
  out.mean = static_cast<float>(mean);
  out.variance = static_cast<float>(variance);
  if (variance > 0.0 && num_x > 0.0) out.autocorrelation_x = static_cast<float>(along_x / num_x / variance);
  if (variance > 0.0 && num_y > 0.0) out.autocorrelation_y = static_cast<float>(along_y / num_y / variance);
  out.kolmogorov_smirnov_p =
      static_cast<float>(kolmogorov_smirnov_p(distance_to_standard_normal(std::move(values)), count));
  return out;
}

}  // namespace

std::vector<NoiseStatistics> noise_statistics(const NoiseField& noise, int grid,
                                              std::span<const uint8_t> mask) {
  if (grid < 1 || noise.width < grid || noise.height < grid || noise.width % grid != 0 ||
      noise.height % grid != 0)
    throw Error(ErrorCode::kUsage, "noise",
                "a field of " + std::to_string(noise.width) + " x " + std::to_string(noise.height) +
                    " latent pixels cannot be cut into " + std::to_string(grid) + " x " +
                    std::to_string(grid) + " views");
  const size_t num_pixels = static_cast<size_t>(noise.width) * static_cast<size_t>(noise.height);
  if (!mask.empty() && mask.size() != num_pixels)
    throw Error(ErrorCode::kUsage, "noise",
                "the mask must have one entry a latent pixel, " + std::to_string(num_pixels) + ", found " +
                    std::to_string(mask.size()));
  const int width = noise.width / grid, height = noise.height / grid;
  std::vector<NoiseStatistics> out;
  for (int row = 0; row < grid; ++row)
    for (int column = 0; column < grid; ++column)
      out.push_back(statistics_of({noise, mask, column * width, row * height, width, height}));
  return out;
}

}  // namespace patina::correspond
