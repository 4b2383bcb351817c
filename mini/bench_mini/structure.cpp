#include "structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "patina/base/check.h"

namespace patina::bench {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Grid {
  const std::vector<float>& values;
  int width, height;
  float operator()(int x, int y) const {
    return values[static_cast<size_t>(std::clamp(y, 0, height - 1) * width + std::clamp(x, 0, width - 1))];
  }
};

std::vector<float> smoothed_luma(const Image& srgb) {
  std::vector<float> luma(srgb.num_pixels()), rows(luma.size());
  for (size_t i = 0; i < luma.size(); ++i) {
    const float* p = &srgb.pixels[i * 3];
    luma[i] = luminance({p[0], p[1], p[2]});
  }
  constexpr std::array<float, 4> kGaussian{0.3991f, 0.2420f, 0.0540f,
                                           0.0044f};  // σ = 1; sums to 1 with its mirror
  const auto pass = [&](std::vector<float>& out, const std::vector<float>& in, int dx, int dy) {
    const Grid at{in, srgb.width, srgb.height};
    for (int y = 0; y < srgb.height; ++y)
      for (int x = 0; x < srgb.width; ++x) {
        float sum = kGaussian[0] * at(x, y);
        for (int d = 1; d < 4; ++d)
          sum +=
              kGaussian[static_cast<size_t>(d)] * (at(x + d * dx, y + d * dy) + at(x - d * dx, y - d * dy));
        out[static_cast<size_t>(y * srgb.width + x)] = sum;
      }
  };
  pass(rows, luma, 1, 0);
  pass(luma, rows, 0, 1);
  return luma;
}

int64_t count_of(const std::vector<uint8_t>& marks) {
  return std::count_if(marks.begin(), marks.end(), [](uint8_t m) { return m != 0; });
}

// Marks of `from` that count and have one of `to` within `tolerance`.
int64_t num_matched(const std::vector<uint8_t>& from, const std::vector<uint8_t>& to,
                    const std::vector<uint8_t>& counts, int width, float tolerance) {
  const int height = static_cast<int>(from.size()) / width, reach = static_cast<int>(tolerance);
  int64_t matched = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto i = static_cast<size_t>(y * width + x);
      if (!from[i] || !counts[i]) continue;
      bool found = false;
      for (int v = std::max(y - reach, 0); v <= std::min(y + reach, height - 1) && !found; ++v)
        for (int u = std::max(x - reach, 0); u <= std::min(x + reach, width - 1) && !found; ++u)
          found = to[static_cast<size_t>(v * width + u)] &&
                  static_cast<float>((u - x) * (u - x) + (v - y) * (v - y)) <= tolerance * tolerance;
      matched += found;
    }
  return matched;
}

// Marks grown by a square of `radius`.
std::vector<uint8_t> grown(const std::vector<uint8_t>& marks, int width, int radius) {
  const int height = static_cast<int>(marks.size()) / width;
  const auto pass = [&](const std::vector<uint8_t>& in, int dx, int dy) {
    std::vector<uint8_t> out(in.size(), 0);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int d = -radius; d <= radius; ++d) {
          const int u = x + d * dx, v = y + d * dy;
          if (u >= 0 && u < width && v >= 0 && v < height && in[static_cast<size_t>(v * width + u)])
            out[static_cast<size_t>(y * width + x)] = 1;
        }
    return out;
  };
  return pass(pass(marks, 1, 0), 0, 1);
}

}  // namespace

std::vector<uint8_t> edge_map(const Image& srgb, float threshold) {
  PATINA_CHECK_EQ(srgb.channels, 3);
  const int width = srgb.width, height = srgb.height;
  const std::vector<float> luma = smoothed_luma(srgb);
  const Grid at{luma, width, height};
  std::vector<float> gx(luma.size()), gy(luma.size()), strength(luma.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto i = static_cast<size_t>(y * width + x);
      gx[i] = 0.5f * (at(x + 1, y) - at(x - 1, y));
      gy[i] = 0.5f * (at(x, y + 1) - at(x, y - 1));
      strength[i] = std::sqrt(gx[i] * gx[i] + gy[i] * gy[i]);
    }
  const Grid strength_at{strength, width, height};
  std::vector<uint8_t> edges(luma.size(), 0);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto i = static_cast<size_t>(y * width + x);
      if (strength[i] < threshold) continue;
      // The neighbours across the edge, along the nearest of eight directions. On a plateau one side wins.
      const int dx = static_cast<int>(std::lround(gx[i] / strength[i])),
                dy = static_cast<int>(std::lround(gy[i] / strength[i]));
      edges[i] = strength[i] >= strength_at(x + dx, y + dy) && strength[i] > strength_at(x - dx, y - dy);
    }
  return edges;
}

double EdgeMatch::precision() const {
  return num_edited ? static_cast<double>(edited_matched) / static_cast<double>(num_edited) : kNone;
}
double EdgeMatch::recall() const {
  return num_original ? static_cast<double>(original_matched) / static_cast<double>(num_original) : kNone;
}
double EdgeMatch::f_score() const {
  const double p = precision(), r = recall();
  return p + r == 0 ? 0 : 2 * p * r / (p + r);
}
void EdgeMatch::add(const EdgeMatch& other) {
  num_edited += other.num_edited, edited_matched += other.edited_matched;
  num_original += other.num_original, original_matched += other.original_matched;
}

EdgeMatch match_edges(const std::vector<uint8_t>& edited, const std::vector<uint8_t>& original,
                      const std::vector<uint8_t>& counts, int width, float tolerance) {
  PATINA_CHECK(edited.size() == original.size() && edited.size() == counts.size());
  const auto counted = [&](const std::vector<uint8_t>& edges) {
    std::vector<uint8_t> both(edges.size());
    for (size_t i = 0; i < edges.size(); ++i) both[i] = edges[i] && counts[i];
    return count_of(both);
  };
  return {.num_edited = counted(edited),
          .edited_matched = num_matched(edited, original, counts, width, tolerance),
          .num_original = counted(original),
          .original_matched = num_matched(original, edited, counts, width, tolerance)};
}

std::vector<uint8_t> ring(const std::vector<uint8_t>& inside, int width, int nearest, int farthest) {
  PATINA_CHECK(0 <= nearest && nearest <= farthest);
  std::vector<uint8_t> out = grown(inside, width, farthest);
  if (nearest == 0) return out;
  const std::vector<uint8_t> near = grown(inside, width, nearest - 1);
  for (size_t i = 0; i < out.size(); ++i) out[i] = out[i] && !near[i];
  return out;
}

double mean_change(const Image& a, const Image& b, const std::vector<uint8_t>& marked) {
  PATINA_CHECK(a.pixels.size() == b.pixels.size() && a.num_pixels() == marked.size());
  const auto channels = static_cast<size_t>(a.channels);
  double sum = 0, count = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    if (marked[i / channels]) sum += std::abs(static_cast<double>(a.pixels[i]) - b.pixels[i]), ++count;
  return count > 0 ? sum / count : kNone;
}

}  // namespace patina::bench
