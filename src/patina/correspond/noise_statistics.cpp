// Whiteness of the noise: moments, lag-1 autocorrelation and the Kolmogorov-Smirnov test against N(0,1), view
// by view.
#include <algorithm>
#include <string>

#include "patina/base/error.h"
#include "patina/correspond/noise.h"
#include "patina/correspond/noise_modes.h"

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

// values [channels, height, width] of one view.
NoiseStatistics statistics_of(const std::vector<float>& values, int width, int height) {
  NoiseStatistics out;
  double sum = 0, sum_of_squares = 0;
  for (const float value : values) {
    sum += value;
    sum_of_squares += static_cast<double>(value) * value;
  }
  const auto count = static_cast<double>(values.size());
  const double mean = sum / count;
  const double variance = sum_of_squares / count - mean * mean;
  double along_x = 0, along_y = 0, num_x = 0, num_y = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    const double here = values[i] - mean;
    const auto x = static_cast<int>(i % static_cast<size_t>(width));
    const auto y = static_cast<int>(i / static_cast<size_t>(width) % static_cast<size_t>(height));
    if (x + 1 < width) along_x += here * (values[i + 1] - mean), ++num_x;
    if (y + 1 < height) along_y += here * (values[i + static_cast<size_t>(width)] - mean), ++num_y;
  }
  out.mean = static_cast<float>(mean);
  out.variance = static_cast<float>(variance);
  if (variance > 0.0 && num_x > 0.0) out.autocorrelation_x = static_cast<float>(along_x / num_x / variance);
  if (variance > 0.0 && num_y > 0.0) out.autocorrelation_y = static_cast<float>(along_y / num_y / variance);
  out.kolmogorov_smirnov_p =
      static_cast<float>(kolmogorov_smirnov_p(distance_to_standard_normal(values), count));
  return out;
}

}  // namespace

std::vector<NoiseStatistics> noise_statistics(const NoiseField& noise, int grid) {
  if (grid < 1 || noise.width < grid || noise.height < grid || noise.width % grid != 0 ||
      noise.height % grid != 0)
    throw Error(ErrorCode::kUsage, "noise",
                "a field of " + std::to_string(noise.width) + " x " + std::to_string(noise.height) +
                    " latent pixels cannot be cut into " + std::to_string(grid) + " x " +
                    std::to_string(grid) + " views");
  const int width = noise.width / grid, height = noise.height / grid;
  std::vector<NoiseStatistics> out;
  for (int row = 0; row < grid; ++row) {
    for (int column = 0; column < grid; ++column) {
      std::vector<float> values;
      values.reserve(kNoiseChannels * static_cast<size_t>(width) * static_cast<size_t>(height));
      for (int channel = 0; channel < kNoiseChannels; ++channel) {
        for (int y = 0; y < height; ++y) {
          const size_t start = (static_cast<size_t>(channel) * static_cast<size_t>(noise.height) +
                                static_cast<size_t>(row * height + y)) *
                                   static_cast<size_t>(noise.width) +
                               static_cast<size_t>(column * width);
          values.insert(
              values.end(), noise.values.begin() + static_cast<std::ptrdiff_t>(start),
              noise.values.begin() + static_cast<std::ptrdiff_t>(start + static_cast<size_t>(width)));
        }
      }
      out.push_back(statistics_of(values, width, height));
    }
  }
  return out;
}

}  // namespace patina::correspond
