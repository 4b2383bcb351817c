#include "patina/inverse/evaluate.h"

#include <algorithm>
#include <array>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/shade.h"

namespace patina::inverse {
namespace {

constexpr int64_t kPixelsPerTask = 256;

// Fitted maps by material and slot.
using FieldTable = std::vector<std::array<const FittedMap*, kNumSlots>>;
FieldTable table_of(std::span<const FittedMap> fitted) {
  FieldTable table;
  for (const FittedMap& map : fitted) {
    const auto m = static_cast<size_t>(map.material);
    if (table.size() <= m) table.resize(m + 1);
    table[m][static_cast<size_t>(map.slot)] = &map;
  }
  return table;
}

// How far the stored values of a sample lie beyond their bounds, signed; zero inside.
struct Overshoot {
  vec3 base_color{0.0f};
  float roughness = 0, metallic = 0;
  vec3 normal{0.0f};
};

// Adds the field's change to `value`, kept within the slot's range; `overshoot` gets what the range cut off.
void add_change(const FittedMap* map, const vec2& uv, float* value, float* overshoot) {
  if (!map) return;
  const asset::Map& delta = map->field.delta;
  const asset::BilinearTap tap = asset::bilinear_tap(delta, uv);
  const auto channels = static_cast<size_t>(delta.texels.channels);
  const Range range = slot_range(map->slot);
  for (size_t c = 0; c < channels; ++c) {
    float change = 0;
    for (size_t t = 0; t < 4; ++t)
      change += tap.weight[t] * delta.texels.pixels[static_cast<size_t>(tap.texel[t]) * channels + c];
    const float moved = stored_from_value(map->slot, value[c]) + change;
    const float kept = std::clamp(moved, range.low, range.high);
    value[c] = value_from_stored(map->slot, kept);
    overshoot[c] = moved - kept;
  }
}

struct CurrentValues {
  MapValues values;
  Overshoot overshoot;
};
CurrentValues current_values(const FieldTable& table, const CacheSample& sample) {
  CurrentValues current{sample.base, {}};
  if (sample.point.material >= table.size()) return current;
  const auto& maps = table[sample.point.material];
  const auto add = [&](Slot slot, float* value, float* overshoot) {
    const auto s = static_cast<size_t>(slot);
    add_change(maps[s], sample.point.uv[s], value, overshoot);
  };
  add(Slot::kBaseColor, &current.values.base_color.x, &current.overshoot.base_color.x);
  add(Slot::kRoughness, &current.values.roughness, &current.overshoot.roughness);
  add(Slot::kMetallic, &current.values.metallic, &current.overshoot.metallic);
  add(Slot::kNormal, &current.values.normal.x, &current.overshoot.normal.x);
  return current;
}

// Beyond a bound the data say nothing about how far to go; a spring leads back, so that a value that overshot
// once is not lost to later iterations. Inside, the gradient is the data's.
float bounded(float gradient, float overshoot, float weight) {
  if (overshoot == 0.0f) return gradient;
  const float inward = overshoot > 0.0f ? std::max(gradient, 0.0f) : std::min(gradient, 0.0f);
  return inward + weight * overshoot;
}
// From the map values to what the fitted maps store.
void to_stored(MapGradient& gradient, const CurrentValues& current, float weight) {
  for (int c = 0; c < 3; ++c) {
    const float stored = stored_from_value(Slot::kBaseColor, current.values.base_color[c]);
    gradient.base_color[c] = bounded(gradient.base_color[c] * d_value_d_stored(Slot::kBaseColor, stored),
                                     current.overshoot.base_color[c], weight);
  }
  gradient.roughness = bounded(gradient.roughness, current.overshoot.roughness, weight);
  gradient.metallic = bounded(gradient.metallic, current.overshoot.metallic, weight);
}

const float* slot_gradient(const MapGradient& gradient, Slot slot) {
  switch (slot) {
    case Slot::kBaseColor:
      return &gradient.base_color.x;
    case Slot::kRoughness:
      return &gradient.roughness;
    case Slot::kMetallic:
      return &gradient.metallic;
    case Slot::kNormal:
      break;
  }
  return &gradient.normal.x;
}

}  // namespace

Evaluation evaluate(const LightCache& cache, std::span<const vec3> other, std::span<const FittedMap> fitted,
                    render::BsdfModel model, float gain) {
  PATINA_CHECK_EQ(other.size(), cache.pixels.size());
  Evaluation result;
  result.radiance.resize(cache.pixels.size());
  const FieldTable table = table_of(fitted);
  std::vector<float> pixel_loss(cache.pixels.size());
  std::vector<MapGradient> gradients(cache.samples.size());
  parallel_for(0, static_cast<int64_t>(cache.pixels.size()), kPixelsPerTask, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const CacheSample& sample = cache.samples[i];
      const CachePixel& pixel = cache.pixels[i];
      const CurrentValues current = current_values(table, sample);
      const Shading shading = shade_values(sample.point, current.values);
      const vec3 radiance = shade(model, sample, shading, cache.lights_of(i));
      const PixelLoss loss = relative_l2(radiance, other[i], pixel.target, gain);
      result.radiance[i] = radiance;
      pixel_loss[i] = pixel.weight * loss.value;
      gradients[i] =
          shade_adjoint(model, sample, shading, cache.lights_of(i), pixel.weight * loss.d_radiance);
      to_stored(gradients[i], current, pixel.weight);
    }
  });

  double loss = 0, weight = 0;
  for (size_t i = 0; i < pixel_loss.size(); ++i) loss += pixel_loss[i], weight += cache.pixels[i].weight;
  result.loss = weight > 0 ? static_cast<float>(loss / weight) : 0.0f;

  // One task a map, each adding its samples in order: no two tasks write to one texel, and no order depends
  // on a thread.
  result.d_delta.resize(fitted.size());
  parallel_for(0, static_cast<int64_t>(fitted.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto f = static_cast<size_t>(begin); f < static_cast<size_t>(end); ++f) {
      const FittedMap& map = fitted[f];
      const asset::Map& delta = map.field.delta;
      Image sum(delta.texels.width, delta.texels.height, delta.texels.channels);
      const auto channels = static_cast<size_t>(sum.channels);
      for (size_t s = 0; s < gradients.size(); ++s) {
        const CacheSample& sample = cache.samples[s];
        if (!sample.hit || sample.point.material != map.material) continue;
        const asset::BilinearTap tap =
            asset::bilinear_tap(delta, sample.point.uv[static_cast<size_t>(map.slot)]);
        const float* gradient = slot_gradient(gradients[s], map.slot);
        for (size_t t = 0; t < 4; ++t)
          for (size_t c = 0; c < channels; ++c)
            sum.pixels[static_cast<size_t>(tap.texel[t]) * channels + c] += tap.weight[t] * gradient[c];
      }
      result.d_delta[f] = std::move(sum);
    }
  });
  return result;
}

std::vector<vec3> shade_pixels(const LightCache& cache, std::span<const FittedMap> fitted,
                               render::BsdfModel model) {
  const FieldTable table = table_of(fitted);
  std::vector<vec3> radiance(cache.pixels.size());
  parallel_for(0, static_cast<int64_t>(cache.pixels.size()), kPixelsPerTask, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const CacheSample& sample = cache.samples[i];
      const Shading shading = shade_values(sample.point, current_values(table, sample).values);
      radiance[i] = shade(model, sample, shading, cache.lights_of(i));
    }
  });
  return radiance;
}

}  // namespace patina::inverse
