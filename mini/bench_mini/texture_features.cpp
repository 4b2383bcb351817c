#include "texture_features.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "patina/base/check.h"
#include "patina/image/color.h"
#include "patina/image/lab.h"

namespace patina::bench {
namespace {

using Plane = std::vector<float>;

// A plane with clamped reads.
struct Reader {
  const Plane& values;
  int width, height;
  float operator()(int x, int y) const {
    return values[static_cast<size_t>(std::clamp(y, 0, height - 1)) * static_cast<size_t>(width) +
                  static_cast<size_t>(std::clamp(x, 0, width - 1))];
  }
};

template <class Value>
Plane made(int width, int height, Value value) {
  Plane out(static_cast<size_t>(width) * static_cast<size_t>(height));
  size_t i = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) out[i++] = value(x, y);
  return out;
}

// Box blur of 2·radius + 1 pixels a side.
Plane blurred(const Plane& plane, int width, int height, int radius) {
  if (radius == 0) return plane;
  const auto pass = [&](const Plane& in, int dx, int dy) {
    const Reader at{in, width, height};
    return made(width, height, [&](int x, int y) {
      float sum = 0;
      for (int d = -radius; d <= radius; ++d) sum += at(x + d * dx, y + d * dy);
      return sum / static_cast<float>(2 * radius + 1);
    });
  };
  return pass(pass(plane, 1, 0), 0, 1);
}

// Number of neighbours that are at least as bright, where the circle changes at most twice between brighter
// and darker; 9 for all other patterns [Ojala2002, Eq. 11]. Ties within `noise` count as brighter.
uint8_t pattern_of(const Reader& at, int x, int y, int radius) {
  constexpr std::array<std::array<int, 2>, 8> kCircle{
      {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
  constexpr float kNoise = 0.5f;  // units of L; flat surfaces then have one pattern and not those of rounding
  const float centre = at(x, y) - kNoise;
  int brighter = 0, changes = 0;
  const auto is_brighter = [&](size_t i) {
    return at(x + radius * kCircle[i % 8][0], y + radius * kCircle[i % 8][1]) >= centre;
  };
  for (size_t i = 0; i < 8; ++i) brighter += is_brighter(i), changes += is_brighter(i) != is_brighter(i + 1);
  return static_cast<uint8_t>(changes <= 2 ? brighter : 9);
}

struct Moments {
  double sum[3] = {}, products[3][3] = {}, cube = 0, count = 0;
};

}  // namespace

TexturePlanes texture_planes(const Image& srgb, const Image& coverage) {
  PATINA_CHECK(srgb.channels == 3 && coverage.channels == 1);
  PATINA_CHECK(srgb.width == coverage.width && srgb.height == coverage.height);
  const int width = srgb.width, height = srgb.height;
  TexturePlanes out{.width = width,
                    .height = height,
                    .lab = {},
                    .gradient = {},
                    .pattern = {},
                    .band = {},
                    .tensor = {},
                    .valid = {}};
  for (Plane& plane : out.lab) plane.resize(srgb.num_pixels());
  for (size_t i = 0; i < srgb.num_pixels(); ++i) {
    const float* p = &srgb.pixels[3 * i];
    const vec3 lab =
        lab_from_linear({linear_from_srgb(p[0]), linear_from_srgb(p[1]), linear_from_srgb(p[2])});
    for (int c = 0; c < 3; ++c) out.lab[c][i] = lab[c];
  }

  const Plane& lightness = out.lab[0];
  for (int scale = 0; scale < 2; ++scale) {
    const int step = 1 << scale;
    const Plane smooth = blurred(lightness, width, height, scale);
    const Reader at{smooth, width, height};
    const Plane gx =
        made(width, height, [&](int x, int y) { return 0.5f * (at(x + step, y) - at(x - step, y)); });
    const Plane gy =
        made(width, height, [&](int x, int y) { return 0.5f * (at(x, y + step) - at(x, y - step)); });
    const auto each = [&](auto value) {
      Plane plane(gx.size());
      for (size_t i = 0; i < gx.size(); ++i) plane[i] = value(gx[i], gy[i]);
      return plane;
    };
    out.gradient[scale] = each([](float x, float y) { return std::sqrt(x * x + y * y); });
    out.tensor[scale][0] = each([](float x, float) { return x * x; });
    out.tensor[scale][1] = each([](float, float y) { return y * y; });
    out.tensor[scale][2] = each([](float x, float y) { return x * y; });
  }
  for (int level = 0; level < 3; ++level) {
    const Plane smooth = blurred(lightness, width, height, level);
    const Reader at{smooth, width, height};
    out.pattern[level].resize(smooth.size());
    for (int y = 0, i = 0; y < height; ++y)
      for (int x = 0; x < width; ++x, ++i)
        out.pattern[level][static_cast<size_t>(i)] = pattern_of(at, x, y, 1 << level);
  }
  for (int c = 0; c < 3; ++c) {
    const Plane fine = blurred(out.lab[c], width, height, 1), coarse = blurred(out.lab[c], width, height, 4);
    for (int b = 0; b < 2; ++b) out.band[c][b].resize(fine.size());
    for (size_t i = 0; i < fine.size(); ++i)
      out.band[c][0][i] = out.lab[c][i] - fine[i], out.band[c][1][i] = fine[i] - coarse[i];
  }

  out.valid.resize(srgb.num_pixels());
  Plane outside(coverage.num_pixels());
  for (size_t i = 0; i < outside.size(); ++i) outside[i] = coverage.pixels[i] < 0.99f ? 1.0f : 0.0f;
  const Plane near_outside = blurred(outside, width, height, kReach);
  for (size_t i = 0; i < outside.size(); ++i) out.valid[i] = near_outside[i] == 0.0f;
  return out;
}

std::vector<Window> windows_on_object(const TexturePlanes& planes, int side, float least_valid) {
  std::vector<Window> out;
  for (int top = 0; top + side <= planes.height; top += side / 2)
    for (int left = 0; left + side <= planes.width; left += side / 2) {
      int valid = 0;
      for (int y = top; y < top + side; ++y)
        for (int x = left; x < left + side; ++x)
          valid += planes.valid[static_cast<size_t>(y * planes.width + x)];
      if (static_cast<float>(valid) >= least_valid * static_cast<float>(side * side))
        out.push_back({left, top, side});
    }
  return out;
}

std::vector<float> texture_features(const TexturePlanes& planes, const Window& window) {
  Moments m;
  std::array<std::array<double, 7>, 2> gradients{};
  std::array<std::array<double, 10>, 3> patterns{};
  double bands[3][2] = {}, tensors[2][3] = {};
  const auto for_each_valid = [&](auto visit) {
    for (int y = window.top; y < window.top + window.side; ++y)
      for (int x = window.left; x < window.left + window.side; ++x) {
        const auto i = static_cast<size_t>(y * planes.width + x);
        if (planes.valid[i]) visit(i);
      }
  };
  for_each_valid([&](size_t i) {
    m.count += 1;
    for (int a = 0; a < 3; ++a) {
      m.sum[a] += planes.lab[a][i];
      for (int b = 0; b < 3; ++b)
        m.products[a][b] += static_cast<double>(planes.lab[a][i]) * planes.lab[b][i];
      for (int b = 0; b < 2; ++b) bands[a][b] += square(planes.band[a][b][i]);
    }
    for (size_t s = 0; s < 2; ++s) {
      // Bins an octave wide, from half a unit of L a pixel.
      const float octave = std::log2(std::max(planes.gradient[s][i], 1e-3f)) + 1.0f;
      gradients[s][static_cast<size_t>(std::clamp(static_cast<int>(std::floor(octave)) + 1, 0, 6))] += 1;
      for (size_t t = 0; t < 3; ++t) tensors[s][t] += planes.tensor[s][t][i];
    }
    for (size_t s = 0; s < 3; ++s) patterns[s][planes.pattern[s][i]] += 1;
  });
  PATINA_CHECK(m.count > 0);

  std::vector<float> out;
  const auto add = [&](double value) { out.push_back(static_cast<float>(value)); };
  double mean[3], deviation[3];
  for (int c = 0; c < 3; ++c) {
    mean[c] = m.sum[c] / m.count;
    // Half a unit keeps constant colour finite: below that 8-bit pictures round.
    deviation[c] = std::sqrt(std::max(m.products[c][c] / m.count - mean[c] * mean[c], 0.0) + 0.25);
    add(mean[c]);
    add(std::log(deviation[c]));
  }
  for (int a = 0; a < 3; ++a)
    for (int b = a + 1; b < 3; ++b)
      add((m.products[a][b] / m.count - mean[a] * mean[b]) / (deviation[a] * deviation[b]));
  for_each_valid([&](size_t i) { m.cube += std::pow((planes.lab[0][i] - mean[0]) / deviation[0], 3); });
  add(m.cube / m.count);
  // Squares let a linear classifier draw closed borders in colour.
  const double chroma = std::sqrt(mean[1] * mean[1] + mean[2] * mean[2]);
  add(chroma);
  add(mean[1] * mean[1]), add(mean[2] * mean[2]), add(mean[1] * mean[2]);
  add(mean[0] * mean[0]), add(mean[0] * mean[1]), add(mean[0] * mean[2]);
  // Hue on the circle, faded out toward grey.
  add(mean[1] / (chroma + 4.0)), add(mean[2] / (chroma + 4.0));
  // Square roots of frequencies: their variance does not depend on the frequency [Freeman1950].
  for (const auto& histogram : gradients)
    for (const double count : histogram) add(std::sqrt(count / m.count));
  for (const auto& histogram : patterns)
    for (const double count : histogram) add(std::sqrt(count / m.count));
  for (const auto& of_channel : bands)
    for (const double energy : of_channel) add(0.5 * std::log(energy / m.count + 0.01));
  for (const auto& t : tensors) {
    // Coherence of the structure tensor, and whether streaks stand upright or lie.
    const double trace = t[0] + t[1] + 1e-3;
    add(std::sqrt(square(t[0] - t[1]) + 4 * t[2] * t[2]) / trace);
    add((t[0] - t[1]) / trace);
  }
  return out;
}

std::vector<float> color_difference(const TexturePlanes& a, const TexturePlanes& b) {
  PATINA_CHECK(a.width == b.width && a.height == b.height);
  Plane out(a.lab[0].size());
  for (size_t i = 0; i < out.size(); ++i)
    out[i] = std::sqrt(square(a.lab[0][i] - b.lab[0][i]) + square(a.lab[1][i] - b.lab[1][i]) +
                       square(a.lab[2][i] - b.lab[2][i]));
  return out;
}

float mean_over(const TexturePlanes& planes, const Window& window, std::span<const float> plane) {
  double sum = 0, count = 0;
  for (int y = window.top; y < window.top + window.side; ++y)
    for (int x = window.left; x < window.left + window.side; ++x) {
      const auto i = static_cast<size_t>(y * planes.width + x);
      if (planes.valid[i]) sum += plane[i], ++count;
    }
  return count > 0 ? static_cast<float>(sum / count) : 0.0f;
}

}  // namespace patina::bench
