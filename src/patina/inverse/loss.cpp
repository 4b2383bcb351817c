#include "patina/inverse/loss.h"

#include <algorithm>
#include <cmath>

#include "patina/base/check.h"
#include "patina/image/color.h"

namespace patina::inverse {
namespace {

// Offsets of all pixels at most `radius` away.
std::vector<ivec2> disc(int radius) {
  std::vector<ivec2> offsets;
  for (int y = -radius; y <= radius; ++y)
    for (int x = -radius; x <= radius; ++x)
      if (x * x + y * y <= radius * radius) offsets.emplace_back(x, y);
  return offsets;
}

// Whether depth jumps between two neighbouring pixels of the surface. One smooth surface at view cosine c
// changes its depth by step · tan(acos c) < step / c over a lateral step; twice that is left for curvature.
bool is_depth_edge(const views::GBuffer& g, size_t a, size_t b) {
  const float jump = std::abs(g.depth[a] - g.depth[b]);
  const float lateral_squared =
      glm::dot(g.p_world[a] - g.p_world[b], g.p_world[a] - g.p_world[b]) - jump * jump;
  // Rounding may push a purely axial step below zero.
  const float lateral = std::sqrt(std::max(lateral_squared, 0.0f));
  const float cosine = std::max(std::min(g.view_cosine[a], g.view_cosine[b]), 0.05f);
  if (jump > 2.0f * lateral / cosine) return true;
  // A small step between surfaces that face the same way leaves both tangent planes; a crease stays in one of
  // them.
  const vec3 step = g.p_world[b] - g.p_world[a];
  const float off_plane = std::min(std::abs(glm::dot(step, g.n_geometric_world[a])),
                                   std::abs(glm::dot(step, g.n_geometric_world[b])));
  return off_plane > 0.8f * glm::length(step);
}

}  // namespace

PixelResidual relative_residual(const vec3& radiance, const vec3& target, float gain) {
  PixelResidual residual;
  for (int c = 0; c < 3; ++c) {
    const float mapped = reinhard(gain * radiance[c]);
    if (target[c] >= kClippedTarget && mapped >= target[c]) continue;
    const float reference = std::max(mapped, target[c]);
    const float scale = 1.0f / std::sqrt(3.0f * (reference * reference + kLossEpsilon));
    residual.value[c] = scale * (mapped - target[c]);
    residual.d_radiance[c] = scale * gain * d_reinhard(gain * radiance[c]);
  }
  return residual;
}

Image loss_target(const Image& edited) {
  PATINA_CHECK_EQ(edited.channels, 3);
  Image target = edited;
  for (float& value : target.pixels) value = linear_from_srgb(std::clamp(value, 0.0f, 1.0f));
  return target;
}

Image loss_weight(const views::GBuffer& g, const std::vector<bool>& materials, int boundary_pixels) {
  const size_t num_pixels = static_cast<size_t>(g.width) * static_cast<size_t>(g.height);
  PATINA_CHECK_EQ(g.material.size(), num_pixels);

  std::vector<bool> inside(num_pixels);
  for (size_t i = 0; i < num_pixels; ++i) {
    const auto material = static_cast<size_t>(g.material[i]);
    inside[i] =
        g.material[i] >= 0 && (materials.empty() || (material < materials.size() && materials[material]));
  }

  // A pixel outside takes its neighbours up to the full distance with it; both sides of a depth edge lie on
  // the edge themselves, so they reach one pixel less far.
  Image weight(g.width, g.height, 1);
  for (size_t i = 0; i < num_pixels; ++i)
    weight.pixels[i] = inside[i] ? std::clamp(g.view_cosine[i] / kGrazingCosine, 0.0f, 1.0f) : 0.0f;
  const std::vector<ivec2> near_outside = disc(std::max(boundary_pixels, 0));
  const std::vector<ivec2> near_edge = disc(std::max(boundary_pixels - 1, 0));
  const auto clear_around = [&](int x, int y, const std::vector<ivec2>& offsets) {
    for (const ivec2& offset : offsets) {
      const int nx = x + offset.x, ny = y + offset.y;
      if (nx >= 0 && ny >= 0 && nx < g.width && ny < g.height) *weight.at(nx, ny) = 0.0f;
    }
  };
  for (int y = 0; y < g.height; ++y) {
    for (int x = 0; x < g.width; ++x) {
      const size_t i = static_cast<size_t>(y) * static_cast<size_t>(g.width) + static_cast<size_t>(x);
      for (const ivec2& step : {ivec2(1, 0), ivec2(0, 1)}) {
        if (x + step.x >= g.width || y + step.y >= g.height) continue;
        const size_t j = i + static_cast<size_t>(step.y * g.width + step.x);
        if (inside[i] != inside[j]) {
          const bool here = !inside[i];
          clear_around(here ? x : x + step.x, here ? y : y + step.y, near_outside);
        } else if (inside[i] && boundary_pixels > 0 && is_depth_edge(g, i, j)) {
          clear_around(x, y, near_edge);
          clear_around(x + step.x, y + step.y, near_edge);
        }
      }
    }
  }
  return weight;
}

}  // namespace patina::inverse
