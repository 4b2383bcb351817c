// What the solvers share: each step is a linear combination of latents, and noise levels as (alpha, sigma,
// lambda). Private to diffusion.
#pragma once

#include <cmath>
#include <initializer_list>
#include <span>
#include <vector>

#include "patina/diffusion/schedulers/schedulers.h"

namespace patina::diffusion {

struct Term {
  double weight;
  std::span<const float> values;
};

/// Σ weight · values, element by element in f64, rounded once. Terms of weight zero are not read.
std::vector<float> combine(std::initializer_list<Term> terms);

/// A noise level σ in the variance-preserving frame of DPM-Solver [Lu2022, Sec. 2]: x = α x0 + σ_vp ε, λ =
/// log(α/σ_vp).
struct NoiseLevel {
  double alpha, sigma, lambda;  // lambda is +inf at σ = 0
};
inline NoiseLevel noise_level(double sigma) {
  const double alpha = 1.0 / std::sqrt(sigma * sigma + 1.0);
  return {alpha, sigma * alpha, -std::log(sigma)};
}

/// The sample x0 that a network output stands for, at x = α x0 + σ ε with α² + σ² = 1.
std::vector<float> predicted_sample(Prediction prediction, double alpha, double sigma,
                                    std::span<const float> model_output, std::span<const float> x);

std::vector<float> step_ddim(const SchedulePlan& plan, int index, std::span<const float> model_output,
                             std::span<const float> x, std::span<const float> noise);
std::vector<float> step_pndm(const SchedulePlan& plan, SchedulerState& state, int index,
                             std::span<const float> model_output, std::span<const float> x);
std::vector<float> step_euler(const SchedulePlan& plan, int index, std::span<const float> model_output,
                              std::span<const float> x, std::span<const float> noise);
std::vector<float> step_dpm_solver(const SchedulePlan& plan, SchedulerState& state, int index,
                                   std::span<const float> model_output, std::span<const float> x,
                                   std::span<const float> noise);
std::vector<float> step_unipc(const SchedulePlan& plan, SchedulerState& state, int index,
                              std::span<const float> model_output, std::span<const float> x);

}  // namespace patina::diffusion
