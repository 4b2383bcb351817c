// The light cache against the edited views: loss of the present textures, and how every pixel's colour
// depends on its map values.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "patina/inverse/fit_state.h"
#include "patina/inverse/light_cache.h"
#include "patina/inverse/sample_taps.h"
#include "patina/inverse/shade.h"

namespace patina::inverse {

/// Map values as an array of floats; a slot's begin at fit_slot(slot).first_value.
inline constexpr size_t kNumValues = sizeof(MapValues) / sizeof(float);

/// How a pixel's residuals, whose squares add up to twice its loss, depend on what the fitted maps store at
/// one of its samples.
struct SampleTerms {
  std::array<MapValues, 3> derivative{};  // of each of the pixel's residuals
  MapValues beyond{};  // how far stored values lie beyond their bounds, signed; zero inside
  float weight = 0;    // of the spring that leads back from there
};

class Evaluator {
 public:
  /// `fitted` must stay where it is; its values may change. `points`: of the cache's samples, in their order.
  /// `gain` = 2^exposure_ev.
  Evaluator(std::span<const FittedMap> fitted, std::span<const SeenPoint> points, render::BsdfModel model,
            float gain);

  /// Radiance of every sample of the cache, [3] linear.
  std::vector<vec3> shade_samples(const LightCache& cache) const;

  /// Loss, the weighted mean over pixels. What follows is of these textures afterwards.
  float evaluate(const LightCache& cache);
  std::span<const vec3> residuals() const { return residuals_; }            // [pixels]
  std::span<const SampleTerms> terms() const { return terms_; }             // [samples]
  std::span<const uint32_t> first_sample() const { return first_sample_; }  // [pixels + 1], the cache's
  const std::vector<vec3>& radiance() const { return radiance_; }           // [pixels], [3] linear

  const SampleTaps& taps_of(size_t fitted_map) const { return taps_[tap_of_[fitted_map]]; }

 private:
  std::vector<float> changes(size_t num_samples) const;
  void evaluate_pixel(const LightCache& cache, size_t pixel, std::span<const float> change, Shader& shader);

  std::span<const FittedMap> fitted_;
  render::BsdfModel model_;
  float gain_;
  std::vector<SampleTaps> taps_;  // of each layout of each material
  std::vector<size_t> tap_of_;    // [fitted]
  std::vector<vec3> residuals_, radiance_;
  std::vector<SampleTerms> terms_;
  std::span<const uint32_t> first_sample_;
};

}  // namespace patina::inverse
