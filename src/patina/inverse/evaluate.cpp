#include "patina/inverse/evaluate.h"

#include <algorithm>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/inverse/fit_slots.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/shade.h"

namespace patina::inverse {
namespace {

constexpr int64_t kPixelsPerTask = 256;
constexpr int64_t kNumbersPerTask = 1 << 15;
// Pixels are added to the maps in this many parts side by side, fewer where that many copies of the maps
// would take more than kPartBytes.
constexpr size_t kMaxParts = 4;
constexpr size_t kPartBytes = size_t{256} << 20;

// How far the stored values of a sample lie beyond their bounds, signed; zero inside.
using Overshoot = MapValues;

// Adds the field's change to `value`, kept within the slot's range; `overshoot` gets what the range cut off.
void add_change(const FittedMap& map, const asset::BilinearTap& tap, float* value, float* overshoot) {
  const Image& delta = map.field.delta.texels;
  const auto channels = static_cast<size_t>(delta.channels);
  const asset::MapSlotRow& row = asset::row_of(map.slot);
  const float* texel[4];
  for (size_t t = 0; t < 4; ++t)
    texel[t] = delta.pixels.data() + static_cast<size_t>(tap.texel[t]) * channels;
  for (size_t c = 0; c < channels; ++c) {
    const float change = tap.weight[0] * texel[0][c] + tap.weight[1] * texel[1][c] +
                         tap.weight[2] * texel[2][c] + tap.weight[3] * texel[3][c];
    const float moved = asset::stored_from_value(row.stored, value[c]) + change;
    const float kept = std::clamp(moved, row.low, row.high);
    value[c] = asset::value_from_stored(row.stored, kept);
    overshoot[c] = moved - kept;
  }
}

// Beyond a bound the data say nothing about how far to go; a spring leads back, so that a value that overshot
// once is not lost to later iterations. Inside, the gradient is the data's.
float bounded(float gradient, float overshoot, float weight) {
  if (overshoot == 0.0f) return gradient;
  const float inward = overshoot > 0.0f ? std::max(gradient, 0.0f) : std::min(gradient, 0.0f);
  return inward + weight * overshoot;
}
// From the map values to what the fitted maps store. Normals have no bounds.
void to_stored(MapGradient& gradient, const MapValues& values, const Overshoot& overshoot, float weight) {
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    if (row.encoding == asset::MapEncoding::kNormal) continue;
    float* g = values_of(gradient, row.slot);
    const float *value = values_of(values, row.slot), *beyond = values_of(overshoot, row.slot);
    for (int c = 0; c < row.channels; ++c) {
      const float stored = asset::stored_from_value(row.stored, value[c]);
      g[c] = bounded(g[c] * asset::d_value_d_stored(row.stored, stored), beyond[c], weight);
    }
  }
}

}  // namespace

struct Evaluator::CurrentValues {
  MapValues values;
  Overshoot overshoot;
};

Evaluator::Evaluator(std::span<const FittedMap> fitted, render::BsdfModel model, float gain)
    : fitted_(fitted), model_(model), gain_(gain) {
  size_t bytes = 1;
  for (const FittedMap& map : fitted) {
    const size_t m = static_cast<size_t>(map.material), s = index_of(map.slot);
    if (materials_.size() <= m) materials_.resize(m + 1);
    MaterialFields& fields = materials_[m];
    fields.map[s] = &map;
    fields.layout[s] = s;
    for (size_t earlier = 0; earlier < s; ++earlier)
      if (fields.map[earlier] && asset::same_layout(fields.map[earlier]->field.delta, map.field.delta)) {
        fields.layout[s] = fields.layout[earlier];
        break;
      }
    const Image& texels = map.field.delta.texels;
    d_delta_.emplace_back(texels.width, texels.height, texels.channels);
    bytes += texels.pixels.size() * sizeof(float);
  }
  parts_.assign(std::clamp<size_t>(kPartBytes / bytes, 1, kMaxParts) - 1, d_delta_);
}

Evaluator::CurrentValues Evaluator::current_values(const CacheSample& sample) const {
  CurrentValues current{sample.base, zero_gradient()};
  if (sample.point.material >= materials_.size()) return current;
  const MaterialFields& fields = materials_[sample.point.material];
  std::array<asset::BilinearTap, asset::kNumMapSlots> taps;
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    const size_t s = index_of(row.slot);
    if (!fields.map[s]) continue;
    const size_t layout = fields.layout[s];
    if (layout == s) taps[s] = asset::bilinear_tap(fields.map[s]->field.delta, sample.point.uv[s]);
    add_change(*fields.map[s], taps[layout], values_of(current.values, row.slot),
               values_of(current.overshoot, row.slot));
  }
  return current;
}

std::vector<vec3> Evaluator::shade_pixels(const LightCache& cache) const {
  std::vector<vec3> radiance(cache.pixels.size());
  parallel_for(0, static_cast<int64_t>(cache.pixels.size()), kPixelsPerTask, [&](int64_t begin, int64_t end) {
    Shader shader(model_);
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const CacheSample& sample = cache.samples[i];
      radiance[i] =
          shader.shade(sample, shade_values(sample.point, current_values(sample).values), cache.lights_of(i));
    }
  });
  return radiance;
}

float Evaluator::evaluate(const LightCache& cache, std::span<const std::span<const vec3>> others,
                          std::vector<vec3>& radiance) {
  PATINA_CHECK(!others.empty());
  const size_t num_pixels = cache.pixels.size();
  radiance.resize(num_pixels);
  pixel_loss_.resize(num_pixels);
  gradients_.resize(num_pixels);
  const float share = 1.0f / static_cast<float>(others.size());
  parallel_for(0, static_cast<int64_t>(num_pixels), kPixelsPerTask, [&](int64_t begin, int64_t end) {
    Shader shader(model_);
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const CacheSample& sample = cache.samples[i];
      const CachePixel& pixel = cache.pixels[i];
      vec3 other(0.0f);
      for (const std::span<const vec3> of_cache : others) other += share * of_cache[i];
      const CurrentValues current = current_values(sample);
      const Shading shading = shade_values(sample.point, current.values);
      radiance[i] = shader.shade(sample, shading, cache.lights_of(i));
      const PixelLoss loss = relative_l2(radiance[i], other, pixel.target, gain_);
      pixel_loss_[i] = pixel.weight * loss.value;
      gradients_[i] = shader.adjoint(pixel.weight * loss.d_radiance);
      to_stored(gradients_[i], current.values, current.overshoot, pixel.weight);
    }
  });
  splat(cache);

  double loss = 0, weight = 0;
  for (size_t i = 0; i < num_pixels; ++i) loss += pixel_loss_[i], weight += cache.pixels[i].weight;
  return weight > 0 ? static_cast<float>(loss / weight) : 0.0f;
}

// Adds the pixels' gradients to the texels that they read. Each task owns one copy of the maps that share a
// layout and adds its part of the pixels in order; then the copies are added in order.
void Evaluator::splat(const LightCache& cache) {
  struct Task {
    size_t part;
    int material;
    size_t layout;
  };
  const size_t num_parts = parts_.size() + 1, num_pixels = cache.pixels.size();
  std::vector<Task> tasks;
  for (size_t m = 0; m < materials_.size(); ++m)
    for (size_t s = 0; s < asset::kNumMapSlots; ++s)
      if (materials_[m].map[s] && materials_[m].layout[s] == s)
        for (size_t part = 0; part < num_parts; ++part) tasks.push_back({part, static_cast<int>(m), s});
  parallel_for(0, static_cast<int64_t>(tasks.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto at = static_cast<size_t>(begin); at < static_cast<size_t>(end); ++at) {
      const Task& task = tasks[at];
      const MaterialFields& fields = materials_[static_cast<size_t>(task.material)];
      struct Target {
        asset::MapSlot slot;
        float* sum;
        size_t channels;
      };
      std::vector<Target> targets;
      for (const asset::MapSlotRow& row : asset::kMapSlots) {
        const size_t s = index_of(row.slot);
        if (!fields.map[s] || fields.layout[s] != task.layout) continue;
        const auto f = static_cast<size_t>(fields.map[s] - fitted_.data());
        Image& sum = task.part == 0 ? d_delta_[f] : parts_[task.part - 1][f];
        std::fill(sum.pixels.begin(), sum.pixels.end(), 0.0f);
        targets.push_back({row.slot, sum.pixels.data(), static_cast<size_t>(sum.channels)});
      }
      const asset::Map& delta = fields.map[task.layout]->field.delta;
      const size_t first = num_pixels * task.part / num_parts,
                   last = num_pixels * (task.part + 1) / num_parts;
      for (size_t i = first; i < last; ++i) {
        const CacheSample& sample = cache.samples[i];
        if (!sample.hit || sample.point.material != task.material) continue;
        const asset::BilinearTap tap = asset::bilinear_tap(delta, sample.point.uv[task.layout]);
        for (const Target& target : targets) {
          const float* gradient = values_of(gradients_[i], target.slot);
          for (size_t t = 0; t < 4; ++t) {
            float* texel = target.sum + static_cast<size_t>(tap.texel[t]) * target.channels;
            for (size_t c = 0; c < target.channels; ++c) texel[c] += tap.weight[t] * gradient[c];
          }
        }
      }
    }
  });
  for (size_t f = 0; f < d_delta_.size(); ++f) {
    std::vector<float>& sum = d_delta_[f].pixels;
    parallel_for(0, static_cast<int64_t>(sum.size()), kNumbersPerTask, [&](int64_t begin, int64_t end) {
      for (const std::vector<Image>& part : parts_)
        for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
          sum[i] += part[f].pixels[i];
    });
  }
}

}  // namespace patina::inverse
