// Euler's method on the probability-flow equation dx/dσ = (x - x0)/σ, and its ancestral form, which steps
// further down and adds noise back [Karras2022, Alg. 1 and 2 without churn].
#include <algorithm>
#include <cmath>

#include "patina/diffusion/schedulers/common.h"

namespace patina::diffusion {

std::vector<float> step_euler(const SchedulePlan& plan, int index, std::span<const float> model_output,
                              std::span<const float> x, std::span<const float> noise) {
  const double sigma = plan.sigmas[static_cast<size_t>(index)],
               sigma_next = plan.sigmas[static_cast<size_t>(index) + 1];
  double sigma_down = sigma_next, sigma_up = 0;
  if (plan.config.solver == Solver::kEulerAncestral) {
    sigma_up = sigma_next * std::sqrt(std::max(0.0, 1 - sigma_next * sigma_next / (sigma * sigma)));
    sigma_down = std::sqrt(std::max(0.0, sigma_next * sigma_next - sigma_up * sigma_up));
  }

  // x is α = 1 here (variance exploding): scale it to the frame in which predictions are defined.
  const NoiseLevel level = noise_level(sigma);
  const std::vector<float> x_scaled = combine({{level.alpha, x}});
  const std::vector<float> x0 =
      predicted_sample(plan.config.prediction, level.alpha, level.sigma, model_output, x_scaled);
  const double ratio = sigma_down / sigma;
  return combine({{ratio, x}, {1 - ratio, x0}, {sigma_up, noise}});
}

}  // namespace patina::diffusion
