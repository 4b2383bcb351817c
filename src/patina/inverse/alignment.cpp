#include "patina/inverse/alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "patina/base/check.h"
#include "patina/base/math.h"

namespace patina::inverse {
namespace {

// Pictures are halved this often at most; the coarsest sees a displacement of eight pixels as two.
constexpr int kLevels = 3;
constexpr int kStepsPerLevel = 3, kSweeps = 30;
// Against the mean evidence of a control point: how strongly neighbours hold on to each other, and all to
// their place.
constexpr float kSmoothness = 0.5f, kStay = 0.02f;
// Sum of squared slopes around a control point that rounding alone stays below.
constexpr float kLeastEvidence = 1e-6f;
// Differences beyond this are of another kind than displacement: a highlight, another edit.
constexpr float kOutlier = 0.1f;
// Below this, interpolation would cost more sharpness than it brings agreement.
constexpr float kNoticeable = 0.5f;

// Detail finer than this counts, in pixels of each level: what light and gloss the textures still lack is
// coarser.
constexpr int kDetailRadius = 4;

struct Level {
  Image rendered, edited, weight;
  float scale = 1;  // pixels of the full picture across one of these
};

// Half the size; `weight` says how much each pixel of `image` counts.
Image halved(const Image& image, const Image& weight) {
  Image out(image.width / 2, image.height / 2, image.channels);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      float sum = 0;
      for (int k = 0; k < 4; ++k) {
        const float w = *weight.at(2 * x + k % 2, 2 * y + k / 2);
        sum += w;
        for (int c = 0; c < image.channels; ++c)
          out.at(x, y)[c] += w * image.at(2 * x + k % 2, 2 * y + k / 2)[c];
      }
      for (int c = 0; c < image.channels; ++c) out.at(x, y)[c] /= std::max(sum, 1e-6f);
    }
  return out;
}

// `image` less the weighted mean around each pixel.
Image detail_of(const Image& image, const Image& weight) {
  // Running sums over rows, then over columns: [H,W,4] of weighted colours and weights.
  Image sums(image.width, image.height, 4);
  for (int y = 0; y < image.height; ++y) {
    vec4 sum(0.0f);
    const auto value = [&](int x) {
      return x < 0 || x >= image.width ? vec4(0.0f) : *weight.at(x, y) * vec4(image.rgb(x, y), 1.0f);
    };
    for (int x = -kDetailRadius; x < image.width; ++x) {
      sum += value(x + kDetailRadius) - value(x - kDetailRadius - 1);
      if (x >= 0) std::copy_n(&sum[0], 4, sums.at(x, y));
    }
  }
  Image out = image;
  for (int x = 0; x < image.width; ++x) {
    vec4 sum(0.0f);
    const auto value = [&](int y) {
      if (y < 0 || y >= image.height) return vec4(0.0f);
      const float* s = sums.at(x, y);
      return vec4(s[0], s[1], s[2], s[3]);
    };
    for (int y = -kDetailRadius; y < image.height; ++y) {
      sum += value(y + kDetailRadius) - value(y - kDetailRadius - 1);
      if (y >= 0) out.set_rgb(x, y, image.rgb(x, y) - vec3(sum) / std::max(sum.w, 1e-3f));
    }
  }
  return out;
}

// Displacement at a pixel centre of a picture whose pixels are `scale` wide.
struct ControlTap {
  std::array<size_t, 4> point;
  std::array<float, 4> weight;
};
ControlTap control_tap(const Image& displacement, float x, float y) {
  const float cx = std::clamp(x / kControlSpacing, 0.0f, static_cast<float>(displacement.width - 1)),
              cy = std::clamp(y / kControlSpacing, 0.0f, static_cast<float>(displacement.height - 1));
  const int x0 = std::min(static_cast<int>(cx), displacement.width - 2),
            y0 = std::min(static_cast<int>(cy), displacement.height - 2);
  const float fx = cx - static_cast<float>(x0), fy = cy - static_cast<float>(y0);
  const auto at = static_cast<size_t>(y0 * displacement.width + x0);
  const auto below = at + static_cast<size_t>(displacement.width);
  return {{at, at + 1, below, below + 1}, {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy}};
}

vec2 at_tap(const Image& displacement, const ControlTap& tap) {
  vec2 sum(0.0f);
  for (size_t k = 0; k < 4; ++k)
    sum += tap.weight[k] *
           vec2(displacement.pixels[2 * tap.point[k]], displacement.pixels[2 * tap.point[k] + 1]);
  return sum;
}

// Cubic interpolation through the four values around t in [0,1) [Catmull1974].
std::array<float, 4> catmull_rom(float t) {
  const float t2 = t * t, t3 = t2 * t;
  return {0.5f * (-t3 + 2 * t2 - t), 0.5f * (3 * t3 - 5 * t2 + 2), 0.5f * (-3 * t3 + 4 * t2 + t),
          0.5f * (t3 - t2)};
}

vec3 interpolated(const Image& image, vec2 position) {
  position = glm::clamp(position, vec2(0.0f),
                        vec2(static_cast<float>(image.width - 1), static_cast<float>(image.height - 1)));
  const vec2 floor = glm::floor(position);
  const auto wx = catmull_rom(position.x - floor.x), wy = catmull_rom(position.y - floor.y);
  vec3 sum(0.0f);
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i)
      sum += wx[static_cast<size_t>(i)] * wy[static_cast<size_t>(j)] *
             image.rgb(std::clamp(static_cast<int>(floor.x) + i - 1, 0, image.width - 1),
                       std::clamp(static_cast<int>(floor.y) + j - 1, 0, image.height - 1));
  return sum;
}

// `level.edited` moved by `displacement`, which is in pixels of the full picture.
Image moved(const Level& level, const Image& displacement) {
  Image out(level.edited.width, level.edited.height, 3);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      const vec2 at(static_cast<float>(x), static_cast<float>(y));
      const ControlTap tap =
          control_tap(displacement, (at.x + 0.5f) * level.scale - 0.5f, (at.y + 0.5f) * level.scale - 0.5f);
      out.set_rgb(x, y, interpolated(level.edited, at + at_tap(displacement, tap) / level.scale));
    }
  return out;
}

// Normal equations of one control point: which displacement its pixels ask for.
struct Evidence {
  float xx = 0, xy = 0, yy = 0;
  vec2 toward{0.0f};  // A · displacement
};

// One Gauss-Newton step at one level.
void improve(const Level& level, Image& displacement) {
  const Image edited = moved(level, displacement);
  std::vector<Evidence> evidence(displacement.num_pixels());
  for (int y = 1; y + 1 < edited.height; ++y)
    for (int x = 1; x + 1 < edited.width; ++x) {
      const float weight = *level.weight.at(x, y);
      if (weight <= 0) continue;
      const ControlTap tap = control_tap(displacement, (static_cast<float>(x) + 0.5f) * level.scale - 0.5f,
                                         (static_cast<float>(y) + 0.5f) * level.scale - 0.5f);
      const vec2 here = at_tap(displacement, tap);
      const vec3 slope_x = (edited.rgb(x + 1, y) - edited.rgb(x - 1, y)) / (2 * level.scale),
                 slope_y = (edited.rgb(x, y + 1) - edited.rgb(x, y - 1)) / (2 * level.scale),
                 difference = level.rendered.rgb(x, y) - edited.rgb(x, y);
      const float trusted = weight / (1 + glm::dot(difference, difference) / square(kOutlier));
      const float xx = trusted * glm::dot(slope_x, slope_x), xy = trusted * glm::dot(slope_x, slope_y),
                  yy = trusted * glm::dot(slope_y, slope_y);
      const vec2 toward(xx * here.x + xy * here.y + trusted * glm::dot(slope_x, difference),
                        xy * here.x + yy * here.y + trusted * glm::dot(slope_y, difference));
      for (size_t k = 0; k < 4; ++k) {
        Evidence& e = evidence[tap.point[k]];
        e.xx += tap.weight[k] * xx, e.xy += tap.weight[k] * xy, e.yy += tap.weight[k] * yy;
        e.toward += tap.weight[k] * toward;
      }
    }
  float mean = 0;
  for (const Evidence& e : evidence) mean += 0.5f * (e.xx + e.yy) / static_cast<float>(evidence.size());
  if (mean < kLeastEvidence) return;

  // Gauss-Seidel: each point in turn solves its own 2 × 2 system with its neighbours held.
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (int y = 0; y < displacement.height; ++y)
      for (int x = 0; x < displacement.width; ++x) {
        Evidence e = evidence[static_cast<size_t>(y * displacement.width + x)];
        e.xx += kStay * mean, e.yy += kStay * mean;
        for (const ivec2& step : {ivec2(1, 0), ivec2(-1, 0), ivec2(0, 1), ivec2(0, -1)}) {
          const ivec2 n = ivec2(x, y) + step;
          if (n.x < 0 || n.y < 0 || n.x >= displacement.width || n.y >= displacement.height) continue;
          const float* of_neighbour = displacement.at(n.x, n.y);
          e.xx += kSmoothness * mean, e.yy += kSmoothness * mean;
          e.toward += kSmoothness * mean * vec2(of_neighbour[0], of_neighbour[1]);
        }
        const float determinant = e.xx * e.yy - e.xy * e.xy;
        vec2 solved =
            vec2(e.yy * e.toward.x - e.xy * e.toward.y, e.xx * e.toward.y - e.xy * e.toward.x) / determinant;
        const float length = glm::length(solved);
        if (length > kMaxDisplacement) solved *= kMaxDisplacement / length;
        displacement.at(x, y)[0] = solved.x, displacement.at(x, y)[1] = solved.y;
      }
}

}  // namespace

Image no_displacement(int width, int height) {
  const auto points = [](int pixels) { return std::max(2, (pixels - 1) / kControlSpacing + 2); };
  return Image(points(width), points(height), 2);
}

Image estimate_displacement(const Image& rendered, const Image& edited, const Image& weight,
                            const Image& start) {
  PATINA_CHECK(rendered.width == edited.width && rendered.height == edited.height);
  PATINA_CHECK(weight.width == edited.width && weight.height == edited.height);
  std::vector<Level> levels{{rendered, edited, weight, 1}};
  while (levels.size() < kLevels && std::min(levels.back().edited.width, levels.back().edited.height) >= 64) {
    const Level& finer = levels.back();
    Image everywhere(finer.weight.width, finer.weight.height, 1);
    std::fill(everywhere.pixels.begin(), everywhere.pixels.end(), 1.0f);
    Level coarser{halved(finer.rendered, finer.weight), halved(finer.edited, everywhere),
                  halved(finer.weight, everywhere), 2 * finer.scale};
    levels.push_back(std::move(coarser));
  }
  for (Level& level : levels) {
    level.rendered = detail_of(level.rendered, level.weight);
    level.edited = detail_of(level.edited, level.weight);
  }
  Image displacement = start;
  for (auto level = levels.rbegin(); level != levels.rend(); ++level)
    for (int step = 0; step < kStepsPerLevel; ++step) improve(*level, displacement);
  return displacement;
}

Image displaced(const Image& edited, const Image& displacement) {
  Image out = edited;
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      const vec2 at(static_cast<float>(x), static_cast<float>(y));
      const vec2 d = at_tap(displacement, control_tap(displacement, at.x, at.y));
      if (glm::length(d) >= kNoticeable) out.set_rgb(x, y, interpolated(edited, at + d));
    }
  return out;
}

}  // namespace patina::inverse
