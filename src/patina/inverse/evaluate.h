// One evaluation of the light cache: loss of the current textures and its gradient with respect to every
// fitted map.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "patina/inverse/fit_state.h"
#include "patina/inverse/light_cache.h"

namespace patina::inverse {

/// Evaluates light caches against the present values of the fitted maps; keeps its large buffers from one
/// evaluation to the next. Sums are taken in a fixed order: no result depends on the number of threads.
class Evaluator {
 public:
  /// `fitted` must stay where it is; its values may change. `gain` = 2^exposure_ev.
  Evaluator(std::span<const FittedMap> fitted, render::BsdfModel model, float gain);

  /// Radiance of every cache pixel, [3] linear.
  std::vector<vec3> shade_pixels(const LightCache& cache) const;

  /// Loss, the weighted mean over pixels. `others`: radiance of the same pixels from other caches, against
  /// the mean of whose errors this cache's is multiplied (relative_l2). `radiance` gets this cache's.
  float evaluate(const LightCache& cache, std::span<const std::span<const vec3>> others,
                 std::vector<vec3>& radiance);

  /// Of the last evaluation: the derivative of the weighted *sum* over pixels with respect to field.delta of
  /// each fitted map, of the same shape.
  std::vector<Image>& d_delta() { return d_delta_; }

 private:
  // Fitted maps of one material by slot, and for each slot the first whose texels lie at the same places.
  struct MaterialFields {
    std::array<const FittedMap*, asset::kNumMapSlots> map{};
    std::array<size_t, asset::kNumMapSlots> layout{};
  };
  struct CurrentValues;
  CurrentValues current_values(const CacheSample& sample) const;
  void splat(const LightCache& cache);

  std::span<const FittedMap> fitted_;
  render::BsdfModel model_;
  float gain_;
  std::vector<MaterialFields> materials_;
  std::vector<Image> d_delta_;
  std::vector<MapGradient> gradients_;  // per pixel
  std::vector<float> pixel_loss_;
  std::vector<std::vector<Image>> parts_;  // [part][map]: sums over a part of the pixels each
};

}  // namespace patina::inverse
