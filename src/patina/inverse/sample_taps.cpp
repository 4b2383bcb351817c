#include "patina/inverse/sample_taps.h"

#include <algorithm>

#include "patina/base/parallel.h"

namespace patina::inverse {
namespace {

constexpr int64_t kRowsPerTask = 1024;

// The transpose of the rows, texel by texel, rows ascending.
void transpose(SampleTaps& taps, size_t num_texels) {
  taps.texel_begin.assign(num_texels + 1, 0);
  for (const SampleTaps::Tap& tap : taps.texel_taps) ++taps.texel_begin[tap.index + 1];
  for (size_t t = 0; t < num_texels; ++t) taps.texel_begin[t + 1] += taps.texel_begin[t];
  taps.row_taps.resize(taps.texel_taps.size());
  std::vector<uint32_t> next(taps.texel_begin.begin(), taps.texel_begin.end() - 1);
  for (size_t row = 0; row < taps.samples.size(); ++row)
    for (uint32_t k = taps.row_begin[row]; k < taps.row_begin[row + 1]; ++k) {
      const SampleTaps::Tap& tap = taps.texel_taps[k];
      taps.row_taps[next[tap.index]++] = {static_cast<uint32_t>(row), tap.weight};
    }
}

}  // namespace

SampleTaps make_sample_taps(const asset::Map& layout, asset::MapSlot slot, int material,
                            std::span<const SeenPoint> points) {
  SampleTaps taps;
  taps.row_begin.push_back(0);
  for (size_t i = 0; i < points.size();) {
    const uint32_t sample = points[i].sample;
    const size_t first = taps.texel_taps.size();
    float num_points = 0;
    for (; i < points.size() && points[i].sample == sample; ++i) {
      if (points[i].point.material != material) continue;
      const asset::BilinearTap tap = asset::bilinear_tap(layout, points[i].point.uv[index_of(slot)]);
      num_points += 1;
      for (size_t k = 0; k < 4; ++k) {
        const auto texel = static_cast<uint32_t>(tap.texel[k]);
        const auto same =
            std::find_if(taps.texel_taps.begin() + static_cast<std::ptrdiff_t>(first), taps.texel_taps.end(),
                         [&](const SampleTaps::Tap& other) { return other.index == texel; });
        if (same != taps.texel_taps.end())
          same->weight += tap.weight[k];
        else
          taps.texel_taps.push_back({texel, tap.weight[k]});
      }
    }
    if (num_points == 0) continue;
    for (size_t k = first; k < taps.texel_taps.size(); ++k) taps.texel_taps[k].weight /= num_points;
    taps.samples.push_back(sample);
    taps.row_begin.push_back(static_cast<uint32_t>(taps.texel_taps.size()));
  }
  transpose(taps, layout.texels.num_pixels());
  return taps;
}

void add_to_samples(const SampleTaps& taps, const Image& texels, size_t stride, float* values) {
  const auto channels = static_cast<size_t>(texels.channels);
  parallel_for(0, static_cast<int64_t>(taps.samples.size()), kRowsPerTask, [&](int64_t begin, int64_t end) {
    for (auto row = static_cast<size_t>(begin); row < static_cast<size_t>(end); ++row) {
      float* out = values + taps.samples[row] * stride;
      for (uint32_t k = taps.row_begin[row]; k < taps.row_begin[row + 1]; ++k) {
        const SampleTaps::Tap& tap = taps.texel_taps[k];
        const float* texel = texels.pixels.data() + tap.index * channels;
        for (size_t c = 0; c < channels; ++c) out[c] += tap.weight * texel[c];
      }
    }
  });
}

void gather_from_samples(const SampleTaps& taps, const float* values, size_t stride, Image& texels) {
  const auto channels = static_cast<size_t>(texels.channels);
  parallel_for(0, static_cast<int64_t>(texels.num_pixels()), kRowsPerTask, [&](int64_t begin, int64_t end) {
    for (auto t = static_cast<size_t>(begin); t < static_cast<size_t>(end); ++t) {
      float* out = texels.pixels.data() + t * channels;
      std::fill_n(out, channels, 0.0f);
      for (uint32_t k = taps.texel_begin[t]; k < taps.texel_begin[t + 1]; ++k) {
        const SampleTaps::Tap& tap = taps.row_taps[k];
        const float* value = values + taps.samples[tap.index] * stride;
        for (size_t c = 0; c < channels; ++c) out[c] += tap.weight * value[c];
      }
    }
  });
}

}  // namespace patina::inverse
