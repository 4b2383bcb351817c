#include "patina/inverse/unseen.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "patina/base/check.h"
#include "patina/base/parallel.h"

namespace patina::inverse {
namespace {

// Grids of 1, 2, 4 … 2^kFinestLevel cells along the longest side of the box around the surface.
constexpr int kFinestLevel = 6;
// From this evidence on a texel counts as seen, in fully weighted pixels: the rim that a look-up just touches
// learned next to nothing.
constexpr float kSeen = 0.1f;
// Seen texels around a point at which half of what it gets comes from their level, the rest from coarser
// ones.
constexpr float kTexelsForHalf = 4.0f;

// Sums over a grid of nodes in space, into which points are spread and from which they are read trilinearly.
class NodeGrid {
 public:
  NodeGrid(const vec3& low, float side, int cells, size_t channels)
      : low_(low), scale_(static_cast<float>(cells) / side), nodes_(cells + 1), channels_(channels) {
    const auto n = static_cast<size_t>(nodes_);
    sums_.assign(n * n * n * channels, 0.0f);
  }

  template <class Function>  // void(float* node, float weight)
  void each_node(const vec3& p, Function&& visit) {
    const vec3 at = glm::clamp((p - low_) * scale_, 0.0f, static_cast<float>(nodes_ - 1) - 1e-3f);
    const ivec3 cell(at);
    const vec3 t = at - vec3(cell);
    for (int corner = 0; corner < 8; ++corner) {
      const ivec3 step(corner & 1, corner >> 1 & 1, corner >> 2);
      const vec3 share = glm::mix(1.0f - t, t, vec3(step));
      const ivec3 node = cell + step;
      const auto index = static_cast<size_t>((node.z * nodes_ + node.y) * nodes_ + node.x);
      visit(sums_.data() + index * channels_, share.x * share.y * share.z);
    }
  }

 private:
  vec3 low_;
  float scale_;
  int nodes_;
  size_t channels_;
  std::vector<float> sums_;
};

}  // namespace

Image spread_to_unseen(const Image& change, const Image& evidence, const SurfaceTexels& surface) {
  const size_t num_texels = change.num_pixels(), channels = static_cast<size_t>(change.channels);
  PATINA_CHECK(evidence.pixels.size() == num_texels && surface.p_world.size() == num_texels);
  vec3 low(std::numeric_limits<float>::infinity()), high(-low);
  bool any_seen = false;
  for (size_t i = 0; i < num_texels; ++i) {
    if (surface.covered.pixels[i] <= 0.0f) continue;
    low = glm::min(low, surface.p_world[i]), high = glm::max(high, surface.p_world[i]);
    any_seen |= evidence.pixels[i] >= kSeen;
  }
  if (!any_seen) return change;
  const vec3 extent = high - low;
  const float side = std::max(std::max(extent.x, extent.y), std::max(extent.z, 1e-20f));

  // Each node: sum of the weighted changes, sum of the weights.
  std::vector<NodeGrid> grids;
  for (int level = 0; level <= kFinestLevel; ++level) grids.emplace_back(low, side, 1 << level, channels + 1);
  parallel_for(0, static_cast<int64_t>(grids.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto level = static_cast<size_t>(begin); level < static_cast<size_t>(end); ++level)
      for (size_t i = 0; i < num_texels; ++i) {
        if (surface.covered.pixels[i] <= 0.0f || evidence.pixels[i] < kSeen) continue;
        const float weight = std::min(evidence.pixels[i], 1.0f);
        const float* value = change.pixels.data() + i * channels;
        grids[level].each_node(surface.p_world[i], [&](float* node, float share) {
          for (size_t c = 0; c < channels; ++c) node[c] += share * weight * value[c];
          node[channels] += share * weight;
        });
      }
  });

  Image out = change;
  parallel_for(0, static_cast<int64_t>(num_texels), 4096, [&](int64_t begin, int64_t end) {
    std::vector<float> sum(channels + 1);
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      if (surface.covered.pixels[i] <= 0.0f || evidence.pixels[i] >= kSeen) continue;
      float* value = out.pixels.data() + i * channels;
      // The coarsest grid has one cell: every point reads something from it.
      for (NodeGrid& grid : grids) {
        std::fill(sum.begin(), sum.end(), 0.0f);
        grid.each_node(surface.p_world[i], [&](const float* node, float share) {
          for (size_t c = 0; c <= channels; ++c) sum[c] += share * node[c];
        });
        const float weight = sum[channels];
        if (weight <= 0.0f) break;  // finer grids have nothing here either
        const float trust = &grid == grids.data() ? 1.0f : weight / (weight + kTexelsForHalf);
        for (size_t c = 0; c < channels; ++c) value[c] += trust * (sum[c] / weight - value[c]);
      }
    }
  });
  return out;
}

}  // namespace patina::inverse
