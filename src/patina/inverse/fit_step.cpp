#include "patina/inverse/fit_step.h"

#include <algorithm>
#include <cmath>

#include "patina/base/parallel.h"
#include "patina/inverse/fit_slots.h"

namespace patina::inverse {
namespace {

// The first fiftieth of the iterations moves levels from a quarter of the finest size down, the second from
// a half, the rest all.
constexpr int kCoarseLevels = 2, kStages = 50;

int finest_level(const FitState& state, const FittedMap& map, int iterations) {
  const int stage = kStages * state.next_iteration / std::max(1, iterations);
  return std::min(std::max(0, kCoarseLevels - stage), static_cast<int>(map.field.levels.size()) - 1);
}

// A cosine from full speed down to a fiftieth: the last iterations average the noise out.
float learning_rate(const FitOptions& options, int iteration) {
  const float t = static_cast<float>(iteration) / static_cast<float>(std::max(1, options.iterations));
  return options.learning_rate * (0.02f + 0.98f * (0.5f + 0.5f * std::cos(kPi * t)));
}

void add_prior(const FittedMap& map, std::vector<Image>& gradients) {
  const Prior& prior = fit_slot(map.slot).prior;
  float detail = prior.detail;
  for (size_t level = 0; level < gradients.size(); ++level, detail *= 0.25f) {
    const std::vector<float>& values = map.field.levels[level].pixels;
    std::vector<float>& gradient = gradients[level].pixels;
    parallel_for(0, static_cast<int64_t>(values.size()), 1 << 15, [&](int64_t begin, int64_t end) {
      for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
        gradient[i] += detail * values[i] / std::sqrt(1.0f + square(values[i] / prior.knee));
    });
  }
}

}  // namespace

void step(FitState& state, std::vector<Image>& d_delta, const FitOptions& options) {
  // Without the maps that should come first nothing is worth waiting for.
  const float progress =
      static_cast<float>(state.next_iteration) / static_cast<float>(std::max(1, options.iterations));
  float first_start = 1.0f;
  for (const FittedMap& map : state.fitted) first_start = std::min(first_start, fit_slot(map.slot).start);
  for (size_t f = 0; f < state.fitted.size(); ++f) {
    FittedMap& map = state.fitted[f];
    if (progress + first_start < fit_slot(map.slot).start) continue;
    Image& gradient = d_delta[f];
    const float change = fit_slot(map.slot).prior.change;
    for (size_t i = 0; i < gradient.pixels.size(); ++i)
      gradient.pixels[i] += change * map.field.delta.texels.pixels[i];
    std::vector<Image> gradients = restrict_to_levels(map.field, gradient);
    add_prior(map, gradients);
    AdamOptions adam;
    // Levels add up: with all of them in step, a texel moves at twice the rate that was asked for.
    adam.learning_rate = fit_slot(map.slot).rate * 2.0f * learning_rate(options, state.next_iteration) /
                         static_cast<float>(gradients.size());
    adam_step(map.field, gradients, finest_level(state, map, options.iterations), adam);
  }
}

}  // namespace patina::inverse
