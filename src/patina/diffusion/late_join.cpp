#include "patina/diffusion/late_join.h"

#include <algorithm>
#include <cmath>

#include "patina/base/check.h"

namespace patina::diffusion {
namespace {

// `values` [C,H,W] takes over `held` at pixels that have not joined at call `index`.
void take_over(const LateJoin& late, int index, std::span<const float> held, std::span<float> values) {
  const size_t num_pixels = late.first_call.size();
  PATINA_CHECK_EQ(held.size(), values.size());
  PATINA_CHECK_EQ(values.size() % num_pixels, size_t{0});
  for (size_t i = 0; i < values.size(); ++i)
    if (late.first_call[i % num_pixels] > index) values[i] = held[i];
}

}  // namespace

std::vector<float> latent_strengths(std::span<const Image> views, int grid, int scale) {
  PATINA_CHECK_EQ(views.size(), static_cast<size_t>(grid) * static_cast<size_t>(grid));
  const int width = views[0].width / scale, height = views[0].height / scale;
  std::vector<float> strengths(static_cast<size_t>(grid * width) * static_cast<size_t>(grid * height), -1.0f);
  for (size_t v = 0; v < views.size(); ++v) {
    const int column = static_cast<int>(v) % grid, row = static_cast<int>(v) / grid;
    for (int y = 0; y < height * scale; ++y)
      for (int x = 0; x < width * scale; ++x) {
        float& strength =
            strengths[static_cast<size_t>(row * height + y / scale) * static_cast<size_t>(grid * width) +
                      static_cast<size_t>(column * width + x / scale)];
        strength = std::max(strength, *views[v].at(x, y));
      }
  }
  for (float& strength : strengths)
    if (strength < 0) strength = 1;
  return strengths;
}

std::vector<int> first_calls(const SchedulePlan& plan, double strength, std::span<const float> strengths) {
  std::vector<int> calls;
  calls.reserve(strengths.size());
  for (const float share : strengths) {
    // A strength that leaves no step to run means: not at all.
    const double own = strength * static_cast<double>(share);
    calls.push_back(own * plan.num_steps < 1 - 1e-5 ? plan.num_calls() : start_index(plan, own));
  }
  return calls;
}

void hold_latents(const LateJoin& late, const SchedulePlan& plan, int index, std::span<float> latents) {
  take_over(late, index - 1, add_noise(plan, index, late.x0, late.noise), latents);
}

void hold_output(const LateJoin& late, const SchedulePlan& plan, int index, std::span<float> output) {
  take_over(late, index, exact_output(plan, index, late.x0, late.noise), output);
}

void restore_start(const LateJoin& late, const SchedulePlan& plan, std::span<float> latents) {
  take_over(late, plan.num_calls() - 1, late.x0, latents);
}

}  // namespace patina::diffusion
