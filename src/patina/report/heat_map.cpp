#include "patina/report/heat_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "patina/base/check.h"

namespace patina::report {
namespace {

// Evenly spaced; luminance rises throughout.
constexpr std::array<vec3, 6> kRamp = {{{0.03f, 0.02f, 0.10f},
                                        {0.24f, 0.07f, 0.42f},
                                        {0.58f, 0.15f, 0.42f},
                                        {0.87f, 0.34f, 0.24f},
                                        {0.97f, 0.65f, 0.22f},
                                        {0.99f, 0.96f, 0.70f}}};

// The cell that holds a pixel's centre.
int cell_of(CellGrid cells, const Image& picture, int x, int y) {
  const int column =
      static_cast<int>((static_cast<int64_t>(2 * x + 1) * cells.columns) / (2 * picture.width));
  const int row = static_cast<int>((static_cast<int64_t>(2 * y + 1) * cells.rows) / (2 * picture.height));
  return row * cells.columns + column;
}

void check(const Image& picture, CellGrid cells) {
  PATINA_CHECK_EQ(picture.channels, 3);
  PATINA_CHECK(cells.columns > 0 && cells.rows > 0);
}

}  // namespace

vec3 heat_color(float share) {
  const float at = std::clamp(share, 0.0f, 1.0f) * static_cast<float>(kRamp.size() - 1);
  const size_t below = std::min(static_cast<size_t>(at), kRamp.size() - 2);
  return glm::mix(kRamp[below], kRamp[below + 1], at - static_cast<float>(below));
}

Image heat_overlay(const Image& picture, CellGrid cells, std::span<const float> values, float brightest) {
  check(picture, cells);
  PATINA_CHECK_EQ(values.size(), static_cast<size_t>(cells.columns) * static_cast<size_t>(cells.rows));
  Image out(picture.width, picture.height, 3);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const float value = values[static_cast<size_t>(cell_of(cells, picture, x, y))];
      const float share = brightest > 0 ? std::sqrt(std::clamp(value / brightest, 0.0f, 1.0f)) : 0.0f;
      const float grey = 0.55f * glm::dot(picture.rgb(x, y), vec3(0.2126f, 0.7152f, 0.0722f));
      // Faint values let the picture through, so that the eye knows where on the object it is.
      out.set_rgb(x, y, glm::mix(vec3(grey), heat_color(share), std::min(1.0f, 0.15f + 0.85f * share)));
    }
  return out;
}

Image with_outline(Image picture, CellGrid cells, std::span<const int32_t> marked, const vec3& color,
                   int thickness) {
  check(picture, cells);
  std::vector<uint8_t> inside(static_cast<size_t>(cells.columns) * static_cast<size_t>(cells.rows));
  for (const int32_t cell : marked) {
    PATINA_CHECK(cell >= 0 && static_cast<size_t>(cell) < inside.size());
    inside[static_cast<size_t>(cell)] = 1;
  }
  const auto is_inside = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < picture.width && y < picture.height &&
           inside[static_cast<size_t>(cell_of(cells, picture, x, y))];
  };
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      if (!is_inside(x, y)) continue;
      bool at_edge = false;
      for (int v = y - thickness; v <= y + thickness && !at_edge; ++v)
        for (int u = x - thickness; u <= x + thickness && !at_edge; ++u) at_edge = !is_inside(u, v);
      if (at_edge) picture.set_rgb(x, y, color);
    }
  return picture;
}

Image with_frame(Image picture, int left, int top, int width, int height, const vec3& color, int thickness) {
  const auto on_frame = [&](int x, int y) {
    const int inward =
        std::min(std::min(x - left, left + width - 1 - x), std::min(y - top, top + height - 1 - y));
    return inward >= 0 && inward < thickness;
  };
  for (int y = std::max(top, 0); y < std::min(top + height, picture.height); ++y)
    for (int x = std::max(left, 0); x < std::min(left + width, picture.width); ++x)
      if (on_frame(x, y)) picture.set_rgb(x, y, color);
  return picture;
}

}  // namespace patina::report
