// DPM-Solver++ multistep of orders one and two, deterministic and stochastic [Lu2022, Alg. 2 and Sec. 4].
#include <cmath>

#include "patina/diffusion/schedulers/common.h"

namespace patina::diffusion {

std::vector<float> step_dpm_solver(const SchedulePlan& plan, SchedulerState& state, int index,
                                   std::span<const float> model_output, std::span<const float> x,
                                   std::span<const float> noise) {
  const SchedulerConfig& config = plan.config;
  const size_t i = static_cast<size_t>(index);
  const NoiseLevel from = noise_level(plan.sigmas[i]), to = noise_level(plan.sigmas[i + 1]);

  std::vector<std::vector<float>>& samples = state.history;
  if (static_cast<int>(samples.size()) == config.solver_order) samples.erase(samples.begin());
  samples.push_back(predicted_sample(config.prediction, from.alpha, from.sigma, model_output, x));

  // A step to σ = 0 has infinite length in λ, where only the first order is defined; short runs end with it
  // for stability.
  const bool is_last = index == plan.num_calls() - 1;
  const bool first_order_end = is_last && (config.final_sigma == FinalSigma::kZero ||
                                           (config.lower_order_final && plan.num_calls() < 15));
  const double h = to.lambda - from.lambda;
  const double growth = config.dpm_sde ? -std::expm1(-2 * h) : -std::expm1(-h);  // 1 - e^(-h), of x0's weight
  const double decay = to.sigma / from.sigma * (config.dpm_sde ? std::exp(-h) : 1.0);
  const double noise_scale = config.dpm_sde ? to.sigma * std::sqrt(growth) : 0.0;

  const std::span<const float> newest = samples.back();
  if (samples.size() < 2 || first_order_end)
    return combine({{decay, x}, {to.alpha * growth, newest}, {noise_scale, noise}});

  const double h_before = from.lambda - noise_level(plan.sigmas[i - 1]).lambda;
  const double length = config.dpm_sde ? 2 * h : h;
  const double slope_weight =
      to.alpha * (config.dpm_variant == DpmVariant::kMidpoint ? 0.5 * growth : 1 - growth / length);
  const double slope = slope_weight * h / h_before;  // times (newest - previous)
  return combine(
      {{decay, x}, {to.alpha * growth + slope, newest}, {-slope, samples.front()}, {noise_scale, noise}});
}

}  // namespace patina::diffusion
