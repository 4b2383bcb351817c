// The solvers that step through ᾱ by training timesteps: DDIM [Song2021] and PNDM in its linear multistep
// form [Liu2022].
#include <algorithm>
#include <cmath>

#include "patina/diffusion/schedulers/common.h"

namespace patina::diffusion {
namespace {

/// ᾱ at a training timestep; before the first one, what set_alpha_to_one says.
double alpha_bar_at(const SchedulePlan& plan, int timestep) {
  if (timestep >= 0) return plan.alphas_cumprod.at(static_cast<size_t>(timestep));
  return plan.config.set_alpha_to_one ? 1.0 : plan.alphas_cumprod.front();
}

/// The reference goes back by a fixed stride, not to the next timestep of the list.
int stride(const SchedulePlan& plan) {
  return plan.config.num_train_timesteps / plan.num_steps;
}

}  // namespace

std::vector<float> step_ddim(const SchedulePlan& plan, int index, std::span<const float> model_output,
                             std::span<const float> x, std::span<const float> noise) {
  const SchedulerConfig& config = plan.config;
  const int t = static_cast<int>(plan.timesteps[static_cast<size_t>(index)]);
  const double alpha_bar = alpha_bar_at(plan, t), alpha_bar_next = alpha_bar_at(plan, t - stride(plan));
  const double alpha = std::sqrt(alpha_bar), sigma = std::sqrt(1 - alpha_bar);

  std::vector<float> x0 = predicted_sample(config.prediction, alpha, sigma, model_output, x);
  std::vector<float> epsilon(model_output.begin(), model_output.end());
  if (config.prediction == Prediction::kV) epsilon = combine({{alpha, model_output}, {sigma, x}});
  if (config.prediction == Prediction::kSample) epsilon = combine({{1 / sigma, x}, {-alpha / sigma, x0}});
  if (config.clip_sample) {
    const float range = static_cast<float>(config.clip_sample_range);
    for (float& value : x0) value = std::clamp(value, -range, range);
  }

  const double variance = (1 - alpha_bar_next) / (1 - alpha_bar) * (1 - alpha_bar / alpha_bar_next);
  const double noise_scale = config.eta * std::sqrt(variance);
  const double direction = std::sqrt(std::max(0.0, 1 - alpha_bar_next - noise_scale * noise_scale));
  return combine({{std::sqrt(alpha_bar_next), x0}, {direction, epsilon}, {noise_scale, noise}});
}

std::vector<float> step_pndm(const SchedulePlan& plan, SchedulerState& state, int index,
                             std::span<const float> model_output, std::span<const float> x) {
  int t = static_cast<int>(plan.timesteps[static_cast<size_t>(index)]);
  int t_next = t - stride(plan);
  std::vector<std::vector<float>>& outputs = state.history;
  std::vector<float> start(x.begin(), x.end());
  std::vector<float> slope(model_output.begin(), model_output.end());

  if (state.calls == 1) {
    // Second call: the first step again, with the mean of its slopes at both ends (Heun).
    t_next = t;
    t += stride(plan);
    slope = combine({{0.5, model_output}, {0.5, outputs.back()}});
    start = std::move(state.last_x);
    state.last_x.clear();
  } else {
    if (outputs.size() > 3) outputs.erase(outputs.begin());
    outputs.push_back(slope);
    const size_t n = outputs.size();
    // Adams-Bashforth of the order that the history allows.
    if (state.calls == 0) {
      state.last_x = start;
    } else if (n == 2) {
      slope = combine({{3 / 2.0, outputs[1]}, {-1 / 2.0, outputs[0]}});
    } else if (n == 3) {
      slope = combine({{23 / 12.0, outputs[2]}, {-16 / 12.0, outputs[1]}, {5 / 12.0, outputs[0]}});
    } else if (n == 4) {
      slope = combine({{55 / 24.0, outputs[3]},
                       {-59 / 24.0, outputs[2]},
                       {37 / 24.0, outputs[1]},
                       {-9 / 24.0, outputs[0]}});
    }
  }

  // [Liu2022, Eq. 11]
  const double alpha_bar = alpha_bar_at(plan, t), alpha_bar_next = alpha_bar_at(plan, t_next);
  const double alpha = std::sqrt(alpha_bar), sigma = std::sqrt(1 - alpha_bar);
  if (plan.config.prediction == Prediction::kV) slope = combine({{alpha, slope}, {sigma, start}});
  if (plan.config.prediction == Prediction::kSample)
    slope = combine({{1 / sigma, start}, {-alpha / sigma, slope}});
  const double denominator =
      alpha_bar * std::sqrt(1 - alpha_bar_next) + std::sqrt(alpha_bar * (1 - alpha_bar) * alpha_bar_next);
  return combine(
      {{std::sqrt(alpha_bar_next / alpha_bar), start}, {-(alpha_bar_next - alpha_bar) / denominator, slope}});
}

}  // namespace patina::diffusion
