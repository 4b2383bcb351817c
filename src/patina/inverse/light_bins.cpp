#include "patina/inverse/light_bins.h"

#include <algorithm>
#include <cmath>

#include "patina/base/portable_math.h"
#include "patina/image/color.h"
#include "patina/render/frame.h"

namespace patina::inverse {
namespace {

constexpr float kMinCosine = 0.01f;

// A ring of cells about the normal, up to this angle between normal and half vector.
struct Ring {
  float degrees;
  int sectors;
};
constexpr std::array<Ring, 12> kRings{{{1.5f, 1},
                                       {3.5f, 4},
                                       {6.0f, 5},
                                       {9.5f, 5},
                                       {14.0f, 6},
                                       {19.0f, 6},
                                       {25.0f, 6},
                                       {32.0f, 6},
                                       {41.0f, 7},
                                       {53.0f, 7},
                                       {70.0f, 6},
                                       {90.0f, 5}}};

struct RingTable {
  std::array<float, kRings.size()> cosine{};  // at the outer border
  std::array<size_t, kRings.size()> first_bin{};
};
const RingTable& ring_table() {
  static const RingTable table = [] {
    RingTable t;
    size_t bin = 0;
    for (size_t r = 0; r < kRings.size(); ++r) {
      t.cosine[r] = std::cos(glm::radians(kRings[r].degrees));
      t.first_bin[r] = bin;
      bin += static_cast<size_t>(kRings[r].sectors);
    }
    return t;
  }();
  return table;
}

}  // namespace

BinFrame bin_frame(const vec3& n, const vec3& wo, float alpha2) {
  const render::Frame frame(n);
  return {n, wo, frame.to_world(vec3(1, 0, 0)), frame.to_world(vec3(0, 1, 0)), alpha2};
}

size_t bin_of(const BinFrame& frame, const vec3& wi) {
  const RingTable& table = ring_table();
  const vec3 half = frame.wo + wi;
  const float length = glm::length(half);
  if (!(length > 1e-6f)) return kNumBins - 1;
  const float cosine = glm::dot(frame.n, half) / length;
  size_t ring = 0;
  while (ring + 1 < kRings.size() && cosine < table.cosine[ring]) ++ring;
  const int sectors = kRings[ring].sectors;
  if (sectors == 1) return table.first_bin[ring];
  const float turn = portable::atan2(glm::dot(frame.y, half), glm::dot(frame.x, half)) / (2.0f * kPi) + 0.5f;
  const int sector = std::min(static_cast<int>(turn * static_cast<float>(sectors)), sectors - 1);
  return table.first_bin[ring] + static_cast<size_t>(sector);
}

void LightBins::add(const BinFrame& frame, const IncidentLight& light) {
  const float n_i = glm::dot(frame.n, light.wi);
  const vec3 half = frame.wo + light.wi;
  const float n_h = glm::dot(frame.n, half);
  if (!(n_i > 0.0f && n_h > kMinCosine)) return;
  const vec2 slope = vec2(glm::dot(frame.x, half), glm::dot(frame.y, half)) / n_h;
  const float length = glm::length(slope);
  const vec3 irradiance = n_i * light.weighted_radiance;
  const float brightness = luminance(irradiance);
  Bin& sum = bins_[bin_of(frame, light.wi)];
  sum.irradiance += irradiance;
  sum.density += brightness / square(length * length + frame.alpha2);
  if (length > 0.0f) sum.azimuth += brightness / length * slope;
}

IncidentLight LightBins::mean(size_t bin, const BinFrame& frame) const {
  const Bin& sum = bins_[bin];
  const float brightness = luminance(sum.irradiance);
  if (!(brightness > 0.0f && sum.density > 0.0f)) return {frame.n, vec3(0.0f)};
  const float length = glm::length(sum.azimuth);
  const vec2 azimuth = length > 0.0f ? sum.azimuth / length : vec2(1, 0);
  float slope = std::sqrt(std::max(std::sqrt(brightness / sum.density) - frame.alpha2, 0.0f));
  // The mean of directions above the horizon may lie below it, since the plane of half vectors bends them.
  for (;; slope *= 0.9f) {
    const vec3 half = glm::normalize(frame.n + slope * (azimuth.x * frame.x + azimuth.y * frame.y));
    const vec3 wi = 2.0f * glm::dot(frame.wo, half) * half - frame.wo;
    const float n_i = glm::dot(frame.n, wi);
    if (n_i > kMinCosine) return {wi, sum.irradiance / n_i};
    if (slope < kMinCosine) return {frame.n, sum.irradiance};
  }
}

}  // namespace patina::inverse
