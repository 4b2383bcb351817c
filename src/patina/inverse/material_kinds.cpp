#include "patina/inverse/material_kinds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "patina/base/parallel.h"
#include "patina/base/portable_math.h"
#include "patina/base/random.h"
#include "patina/image/color.h"
#include "patina/image/image.h"

namespace patina::inverse {
namespace {

constexpr size_t kMaxSampled = 1 << 14;
// Of samples that share their pixel's colour with others.
constexpr float kWeightOfShares = 0.05f;
constexpr int kMaxMoves = 16;
constexpr float kMinWidth = 0.03f;

template <class Feature>
float distance2(const Feature& a, const Feature& b) {
  float sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += square(a[i] - b[i]);
  return sum;
}

template <class Feature>
size_t nearest(std::span<const Feature> centres, const Feature& feature) {
  size_t best = 0;
  for (size_t k = 1; k < centres.size(); ++k)
    if (distance2(centres[k], feature) < distance2(centres[best], feature)) best = k;
  return best;
}

}  // namespace

MaterialKinds::MaterialKinds(const LightCache& cache, std::span<const vec3> clean_radiance, float gain,
                             std::span<const uint32_t> samples)
    : features_(cache.samples.size()), weights_(cache.samples.size()) {
  for (const uint32_t i : samples) {
    const CacheSample& sample = cache.samples[i];
    const CachePixel& pixel = cache.pixels[sample.pixel];
    features_[i] = feature_of(pixel, sample, clean_radiance[i], gain);
    weights_[i] = pixel.weight * (sample.share < 1.0f ? kWeightOfShares : 1.0f);
  }
  find_centres(samples);
}

// Cube roots, so that equal distances look about equal.
MaterialKinds::Feature MaterialKinds::feature_of(const CachePixel& pixel, const CacheSample& sample,
                                                 const vec3& clean_radiance, float gain) {
  constexpr float kDark = 0.02f;      // as much as a dielectric without colour reflects
  constexpr float kOfSurface = 0.5f;  // weight of roughness and metallic beside colour
  Feature feature{};
  const float clean_luminance = luminance(clean_radiance);
  for (int c = 0; c < 3; ++c) {
    const float base = sample.base.base_color[c];
    const float mapped = std::min(pixel.target[c], 0.95f);
    const float edited = mapped / (1.0f - mapped) / gain;
    const float light = clean_radiance[c] + 0.02f * clean_luminance + 1e-4f;
    feature[static_cast<size_t>(c)] = portable::cbrt(std::clamp((base + kDark) * edited / light, 0.0f, 1.0f));
    feature[static_cast<size_t>(c) + 3] = portable::cbrt(base);
  }
  feature[6] = kOfSurface * sample.base.roughness;
  feature[7] = kOfSurface * sample.base.metallic;
  return feature;
}

// k-means, begun far apart [Arthur2007].
void MaterialKinds::find_centres(std::span<const uint32_t> samples) {
  std::vector<uint32_t> sampled;
  const size_t step = std::max<size_t>(1, samples.size() / kMaxSampled);
  for (size_t k = 0; k < samples.size(); k += step) sampled.push_back(samples[k]);
  if (sampled.empty()) return;

  RandomStream random(0, RandomPurpose::kMaterialKinds, 0);
  std::vector<float> apart(sampled.size(), std::numeric_limits<float>::infinity());
  centres_.push_back(features_[sampled[0]]);
  while (centres_.size() < KindShares::kNumKinds) {
    double total = 0;
    for (size_t k = 0; k < sampled.size(); ++k) {
      apart[k] = std::min(apart[k], distance2(features_[sampled[k]], centres_.back()));
      total += double{apart[k]} * weights_[sampled[k]];
    }
    if (!(total > 0)) break;
    double left = total * random.uniform();
    size_t chosen = 0;
    while (chosen + 1 < sampled.size() && (left -= double{apart[chosen]} * weights_[sampled[chosen]]) > 0)
      ++chosen;
    centres_.push_back(features_[sampled[chosen]]);
  }

  for (int move = 0; move < kMaxMoves; ++move) {
    std::vector<std::array<double, kNumFeatures>> sums(centres_.size());
    std::vector<double> counts(centres_.size());
    double squared = 0, count = 0;
    for (const uint32_t i : sampled) {
      const size_t k = nearest<Feature>(centres_, features_[i]);
      for (size_t d = 0; d < kNumFeatures; ++d) sums[k][d] += double{weights_[i]} * features_[i][d];
      counts[k] += weights_[i];
      squared += double{weights_[i]} * distance2(features_[i], centres_[k]);
      count += weights_[i];
    }
    for (size_t k = 0; k < centres_.size(); ++k)
      for (size_t d = 0; d < kNumFeatures && counts[k] > 0; ++d)
        centres_[k][d] = static_cast<float>(sums[k][d] / counts[k]);
    width_ = std::max(kMinWidth, static_cast<float>(std::sqrt(squared / count)));
  }
}

std::vector<uint16_t> MaterialKinds::kinds_of(std::span<const uint32_t> samples) const {
  std::vector<uint16_t> kinds;
  for (const uint32_t sample : samples)
    kinds.push_back(static_cast<uint16_t>(nearest<Feature>(centres_, features_[sample])));
  return kinds;
}

KindShares MaterialKinds::shares(const SampleTaps& taps) const {
  KindShares out;
  const size_t num_texels = taps.texel_begin.size() - 1;
  out.texels.resize(num_texels);
  parallel_for(0, static_cast<int64_t>(num_texels), 1024, [&](int64_t begin, int64_t end) {
    for (auto t = static_cast<size_t>(begin); t < static_cast<size_t>(end); ++t) {
      Feature mean{};
      float weight = 0;
      for (uint32_t k = taps.texel_begin[t]; k < taps.texel_begin[t + 1]; ++k) {
        const SampleTaps::Tap& tap = taps.row_taps[k];
        const uint32_t sample = taps.samples[tap.index];
        for (size_t d = 0; d < kNumFeatures; ++d)
          mean[d] += tap.weight * weights_[sample] * features_[sample][d];
        weight += tap.weight * weights_[sample];
      }
      if (!(weight > 0)) continue;
      for (float& value : mean) value /= weight;

      std::array<std::pair<float, uint16_t>, KindShares::kNumKinds> by_distance;
      const size_t num = centres_.size();
      for (size_t k = 0; k < num; ++k)
        by_distance[k] = {distance2(mean, centres_[k]), static_cast<uint16_t>(k)};
      const size_t kept = std::min(num, KindShares::kPerTexel);
      std::partial_sort(by_distance.begin(), by_distance.begin() + kept, by_distance.begin() + num);
      float total = 0;
      for (size_t k = 0; k < kept; ++k) {
        const float far = by_distance[k].first - by_distance[0].first;
        out.texels[t][k] = {by_distance[k].second, std::exp(-0.5f * far / square(width_))};
        total += out.texels[t][k].share;
      }
      for (KindShares::Share& share : out.texels[t]) share.share /= total;
    }
  });
  return out;
}

}  // namespace patina::inverse
