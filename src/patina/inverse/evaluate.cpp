#include "patina/inverse/evaluate.h"

#include <algorithm>
#include <cmath>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/inverse/fit_slots.h"
#include "patina/inverse/loss.h"

namespace patina::inverse {
namespace {

constexpr int64_t kPixelsPerTask = 256;

// `base` with `change` added to what is stored, kept within bounds.
struct CurrentValues {
  MapValues values;
  MapValues beyond;  // what the bounds cut off
};
CurrentValues current_values(const MapValues& base, const float* change) {
  CurrentValues current{base, zero_gradient()};
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    float* value = values_of(current.values, row.slot);
    float* beyond = values_of(current.beyond, row.slot);
    const float* moved_by = change + fit_slot(row.slot).first_value;
    for (int c = 0; c < row.channels; ++c) {
      if (moved_by[c] == 0.0f) continue;
      const float moved = asset::stored_from_value(row.stored, value[c]) + moved_by[c];
      const float kept = std::clamp(moved, row.low, row.high);
      value[c] = asset::value_from_stored(row.stored, kept);
      beyond[c] = moved - kept;
    }
  }
  return current;
}

// From derivatives with respect to values to those with respect to what is stored; beyond a bound nothing
// changes any more.
void to_stored(MapGradient& gradient, const CurrentValues& current) {
  for (const asset::MapSlotRow& row : asset::kMapSlots) {
    float* g = values_of(gradient, row.slot);
    const float *value = values_of(current.values, row.slot), *beyond = values_of(current.beyond, row.slot);
    for (int c = 0; c < row.channels; ++c) {
      const float stored = asset::stored_from_value(row.stored, value[c]);
      g[c] = beyond[c] == 0.0f ? g[c] * asset::d_value_d_stored(row.stored, stored) : 0.0f;
    }
  }
}

}  // namespace

Evaluator::Evaluator(std::span<const FittedMap> fitted, std::span<const SeenPoint> points,
                     render::BsdfModel model, float gain)
    : fitted_(fitted), model_(model), gain_(gain) {
  std::vector<size_t> map_of_tap;
  for (size_t f = 0; f < fitted.size(); ++f) {
    const FittedMap& map = fitted[f];
    const auto same = std::find_if(map_of_tap.begin(), map_of_tap.end(), [&](size_t other) {
      return fitted[other].material == map.material &&
             asset::same_layout(fitted[other].field.delta, map.field.delta);
    });
    tap_of_.push_back(static_cast<size_t>(same - map_of_tap.begin()));
    if (same != map_of_tap.end()) continue;
    map_of_tap.push_back(f);
    taps_.push_back(make_sample_taps(map.field.delta, map.slot, map.material, points));
  }
}

// [samples, kNumValues] changes of what is stored.
std::vector<float> Evaluator::changes(size_t num_samples) const {
  std::vector<float> changes(num_samples * kNumValues, 0.0f);
  for (size_t f = 0; f < fitted_.size(); ++f)
    add_to_samples(taps_of(f), fitted_[f].field.delta.texels, kNumValues,
                   changes.data() + fit_slot(fitted_[f].slot).first_value);
  return changes;
}

std::vector<vec3> Evaluator::shade_samples(const LightCache& cache) const {
  std::vector<vec3> radiance(cache.samples.size());
  const std::vector<float> change = changes(cache.samples.size());
  parallel_for(
      0, static_cast<int64_t>(cache.samples.size()), kPixelsPerTask, [&](int64_t begin, int64_t end) {
        Shader shader(model_);
        for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
          const CacheSample& sample = cache.samples[i];
          const CurrentValues current = current_values(sample.base, change.data() + i * kNumValues);
          radiance[i] = shader.shade(sample, shade_values(sample.point, current.values), cache.lights_of(i));
        }
      });
  return radiance;
}

void Evaluator::evaluate_pixel(const LightCache& cache, size_t i, std::span<const float> change,
                               Shader& shader) {
  const CachePixel& pixel = cache.pixels[i];
  const size_t first = cache.first_sample[i], last = cache.first_sample[i + 1];
  const auto shade = [&](size_t s) {
    const CacheSample& sample = cache.samples[s];
    const CurrentValues current = current_values(sample.base, change.data() + s * kNumValues);
    return std::pair(current, shade_values(sample.point, current.values));
  };
  radiance_[i] = vec3(0.0f);
  for (size_t s = first; s < last; ++s) {
    const auto [current, shading] = shade(s);
    radiance_[i] += cache.samples[s].share * shader.shade(cache.samples[s], shading, cache.lights_of(s));
  }
  radiance_[i] *= pixel.calibration;
  const PixelResidual residual = relative_residual(radiance_[i], pixel.target, gain_);
  const float scale = std::sqrt(2.0f * pixel.weight);
  residuals_[i] = scale * residual.value;
  for (size_t s = first; s < last; ++s) {
    const CacheSample& sample = cache.samples[s];
    const auto [current, shading] = shade(s);
    // The shader remembers the one that it shaded last.
    if (last - first > 1) shader.shade(sample, shading, cache.lights_of(s));
    SampleTerms& terms = terms_[s];
    terms = {.beyond = current.beyond, .weight = sample.share * pixel.weight};
    for (int c = 0; c < 3; ++c) {
      vec3 d_radiance(0.0f);
      d_radiance[c] = scale * sample.share * pixel.calibration[c] * residual.d_radiance[c];
      if (d_radiance[c] == 0.0f) continue;
      MapValues& derivative = terms.derivative[static_cast<size_t>(c)];
      derivative = shader.adjoint(d_radiance);
      to_stored(derivative, current);
    }
  }
}

float Evaluator::evaluate(const LightCache& cache) {
  const size_t num_pixels = cache.pixels.size();
  radiance_.resize(num_pixels);
  residuals_.resize(num_pixels);
  terms_.resize(cache.samples.size());
  first_sample_ = cache.first_sample;
  const std::vector<float> change = changes(cache.samples.size());
  parallel_for(0, static_cast<int64_t>(num_pixels), kPixelsPerTask, [&](int64_t begin, int64_t end) {
    Shader shader(model_);
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
      evaluate_pixel(cache, i, change, shader);
  });

  double loss = 0, weight = 0;
  for (size_t i = 0; i < num_pixels; ++i) {
    loss += 0.5 * glm::dot(residuals_[i], residuals_[i]);
    weight += cache.pixels[i].weight;
  }
  return weight > 0 ? static_cast<float>(loss / weight) : 0.0f;
}

}  // namespace patina::inverse
