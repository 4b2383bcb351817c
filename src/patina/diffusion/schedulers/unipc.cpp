// UniPC of orders one and two on predicted samples: the corrector improves the latent with the output just
// computed, then the predictor steps on [Zhao2023, Alg. 5 and 6, B(h) = h or e^h - 1].
#include <algorithm>
#include <array>
#include <cmath>

#include "patina/diffusion/schedulers/common.h"

namespace patina::diffusion {
namespace {

/// The step from sigma index `from` to from + 1, in the signed length hh = -h of [Zhao2023].
struct Interval {
  NoiseLevel start, end;
  double h;      // λ grows by this; inf when it ends at σ = 0
  double phi_1;  // e^hh - 1
  double b_h;    // B(hh)
};

Interval interval(const SchedulePlan& plan, int from) {
  Interval result{};
  result.start = noise_level(plan.sigmas[static_cast<size_t>(from)]);
  result.end = noise_level(plan.sigmas[static_cast<size_t>(from) + 1]);
  result.h = result.end.lambda - result.start.lambda;
  result.phi_1 = std::expm1(-result.h);
  result.b_h = plan.config.unipc_variant == UniPcVariant::kBh1 ? -result.h : result.phi_1;
  return result;
}

/// Where the sample before `from` lies, in units of the interval: negative.
double previous_position(const SchedulePlan& plan, const Interval& step, int from) {
  return (noise_level(plan.sigmas[static_cast<size_t>(from) - 1]).lambda - step.start.lambda) / step.h;
}

/// Weights (rho of the previous sample's difference, rho of the new output's) of the corrector of order two:
/// they solve [1 1; r 1] rho = b with b_k = k! phi_(k+1)(hh) hh / B(hh).
std::array<double, 2> corrector_weights(const Interval& step, double r) {
  const double hh = -step.h;
  const double phi_2 = step.phi_1 / hh - 1, phi_3 = phi_2 / hh - 0.5;
  const double b_1 = phi_2 / step.b_h, b_2 = 2 * phi_3 / step.b_h;
  const double rho_previous = (b_1 - b_2) / (1 - r);
  return {rho_previous, b_1 - rho_previous};
}

}  // namespace

std::vector<float> step_unipc(const SchedulePlan& plan, SchedulerState& state, int index,
                              std::span<const float> model_output, std::span<const float> x) {
  const SchedulerConfig& config = plan.config;
  std::vector<std::vector<float>>& samples = state.history;
  const NoiseLevel level = noise_level(plan.sigmas[static_cast<size_t>(index)]);
  std::vector<float> newest = predicted_sample(config.prediction, level.alpha, level.sigma, model_output, x);

  // Correct the latent that the last predictor arrived at.
  std::vector<float> corrected(x.begin(), x.end());
  if (state.calls > 0) {
    const Interval last = interval(plan, index - 1);
    const double scale = -last.end.alpha * last.b_h;
    const std::vector<float>& m0 = samples.back();
    const double x_weight = last.end.sigma / last.start.sigma, m0_weight = -last.end.alpha * last.phi_1;
    if (state.last_order < 2) {
      corrected = combine({{x_weight, state.last_x}, {m0_weight - 0.5 * scale, m0}, {0.5 * scale, newest}});
    } else {
      const double r = previous_position(plan, last, index - 1);
      const auto [rho_previous, rho_new] = corrector_weights(last, r);
      corrected = combine({{x_weight, state.last_x},
                           {m0_weight - scale * (rho_previous / r + rho_new), m0},
                           {scale * rho_previous / r, samples.front()},
                           {scale * rho_new, newest}});
    }
  }

  if (static_cast<int>(samples.size()) == config.solver_order) samples.erase(samples.begin());
  samples.push_back(std::move(newest));

  // Predict. The last step is of first order if asked for, and always where it ends at σ = 0 (infinite length
  // in λ).
  const Interval next = interval(plan, index);
  int order = static_cast<int>(samples.size());
  if (index == plan.num_calls() - 1 && (config.lower_order_final || std::isinf(next.h))) order = 1;
  state.last_order = order;
  state.last_x = corrected;
  const double x_weight = next.end.sigma / next.start.sigma, m0_weight = -next.end.alpha * next.phi_1;
  if (order < 2) return combine({{x_weight, corrected}, {m0_weight, samples.back()}});
  const double weight = -next.end.alpha * next.b_h * 0.5 / previous_position(plan, next, index);
  return combine({{x_weight, corrected}, {m0_weight - weight, samples.back()}, {weight, samples.front()}});
}

}  // namespace patina::diffusion
