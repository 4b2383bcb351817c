#include "patina/correspond/noise_projection.h"

#include "patina/base/parallel.h"
#include "patina/base/random.h"

namespace patina::correspond {

std::vector<std::array<float, kNoiseChannels>> draw(const NoiseProjection& projection, uint64_t seed) {
  std::vector<std::array<float, kNoiseChannels>> out(projection.scale.size());
  // A pixel's sum runs in one thread and in the order of its entries: the same bits with any number of
  // threads.
  parallel_for(0, static_cast<int64_t>(out.size()), 64, [&](int64_t begin, int64_t end) {
    for (auto pixel = static_cast<size_t>(begin); pixel < static_cast<size_t>(end); ++pixel) {
      std::array<float, kNoiseChannels> sum{};
      for (int64_t k = projection.first[pixel]; k < projection.first[pixel + 1]; ++k) {
        const auto entry = static_cast<size_t>(k);
        const auto value =
            gaussian4(seed, RandomPurpose::kNoiseField, projection.index[entry], projection.field);
        const float weight = projection.weight.empty() ? 1.0f : projection.weight[entry];
        for (size_t channel = 0; channel < kNoiseChannels; ++channel) sum[channel] += weight * value[channel];
      }
      for (size_t channel = 0; channel < kNoiseChannels; ++channel)
        out[pixel][channel] = projection.scale[pixel] * sum[channel];
    }
  });
  return out;
}

}  // namespace patina::correspond
