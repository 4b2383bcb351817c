// Timesteps and noise levels of a run: betas -> ᾱ -> timesteps by spacing -> sigmas (Karras or interpolated).
// Tables are rounded to f32 where the reference keeps them in f32, so that timesteps and sigmas agree with
// it.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "patina/base/error.h"
#include "patina/diffusion/schedulers/schedulers.h"

namespace patina::diffusion {
namespace {

[[noreturn]] void refuse(const std::string& message) {
  throw Error(ErrorCode::kUsage, "scheduler", message);
}

/// count values from first to last, in f32 from both ends toward the middle.
std::vector<float> linspace_f32(float first, float last, int count) {
  std::vector<float> values(static_cast<size_t>(count));
  const float delta = count > 1 ? (last - first) / static_cast<float>(count - 1) : 0.0f;
  for (int i = 0; i < count; ++i)
    values[static_cast<size_t>(i)] = i < count / 2 ? first + delta * static_cast<float>(i)
                                                   : last - delta * static_cast<float>(count - i - 1);
  return values;
}

std::vector<float> betas(const SchedulerConfig& config) {
  if (!config.trained_betas.empty()) return config.trained_betas;
  const int count = config.num_train_timesteps;
  switch (config.beta_schedule) {
    case BetaSchedule::kLinear:
      return linspace_f32(static_cast<float>(config.beta_start), static_cast<float>(config.beta_end), count);
    case BetaSchedule::kScaledLinear: {
      std::vector<float> values = linspace_f32(static_cast<float>(std::sqrt(config.beta_start)),
                                               static_cast<float>(std::sqrt(config.beta_end)), count);
      for (float& value : values) value *= value;
      return values;
    }
    case BetaSchedule::kSquaredCosine:
      break;
  }
  // [Nichol2021, Eq. 17], each beta capped so that ᾱ never reaches zero.
  const auto alpha_bar = [](double t) {
    const double c = std::cos((t + 0.008) / 1.008 * std::numbers::pi / 2);
    return c * c;
  };
  std::vector<float> values(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i)
    values[static_cast<size_t>(i)] =
        static_cast<float>(std::min(1 - alpha_bar((i + 1.0) / count) / alpha_bar(1.0 * i / count), 0.999));
  return values;
}

bool is_euler(Solver solver) {
  return solver == Solver::kEuler || solver == Solver::kEulerAncestral;
}
bool is_multistep(Solver solver) {
  return solver == Solver::kDpmSolverPp || solver == Solver::kUniPc;
}

/// √ᾱ shifted and scaled so that the first stays and the last is zero [Lin2024, Alg. 1]. Solvers that
/// calculate with σ get 2⁻²⁴ there, as the reference gives them: σ = 4096 instead of infinity.
std::vector<double> with_pure_noise_at_the_end(std::vector<double> alphas_cumprod, Solver solver) {
  const double first = std::sqrt(alphas_cumprod.front()), last = std::sqrt(alphas_cumprod.back());
  for (double& alpha_bar : alphas_cumprod) {
    const double signal = (std::sqrt(alpha_bar) - last) * first / (first - last);
    alpha_bar = static_cast<double>(static_cast<float>(signal * signal));
  }
  alphas_cumprod.back() = is_euler(solver) || is_multistep(solver) ? std::ldexp(1.0, -24) : 0.0;
  return alphas_cumprod;
}

std::vector<double> alphas_cumprod(const SchedulerConfig& config) {
  std::vector<double> result;
  double product = 1;
  for (const float beta : betas(config)) {
    product *= static_cast<double>(1.0f - beta);
    result.push_back(static_cast<double>(static_cast<float>(product)));
  }
  return config.zero_terminal_snr ? with_pure_noise_at_the_end(result, config.solver) : result;
}

TimestepSpacing spacing_of(const SchedulerConfig& config) {
  if (config.spacing) return *config.spacing;
  return config.solver == Solver::kDdim || config.solver == Solver::kPndm ? TimestepSpacing::kLeading
                                                                          : TimestepSpacing::kLinspace;
}

/// Descending timesteps, one a step; nearbyint rounds halves to even like the reference. The multistep
/// solvers space num_steps + 1 points and leave the last one out; the Euler solvers take fractions.
std::vector<double> spaced_timesteps(const SchedulerConfig& config, int num_steps) {
  const int train = config.num_train_timesteps;
  const int points = is_multistep(config.solver) ? num_steps + 1 : num_steps;
  std::vector<double> timesteps;
  for (int i = 0; i < num_steps; ++i) {
    const int from_end = points - 1 - i;
    switch (spacing_of(config)) {
      case TimestepSpacing::kLinspace: {
        const double delta = points > 1 ? static_cast<double>(train - 1) / (points - 1) : 0.0;
        const double t = from_end == points - 1 && points > 1 ? train - 1 : from_end * delta;
        timesteps.push_back(is_euler(config.solver) ? static_cast<double>(static_cast<float>(t))
                                                    : std::nearbyint(t));
        break;
      }
      case TimestepSpacing::kLeading:
        timesteps.push_back(from_end * (train / points) + config.steps_offset);
        break;
      case TimestepSpacing::kTrailing:
        timesteps.push_back(std::nearbyint(train - i * (static_cast<double>(train) / num_steps)) - 1);
        break;
    }
  }
  if (timesteps.front() > train - 1)
    refuse("cannot take " + std::to_string(num_steps) + " of " + std::to_string(train) +
           " timesteps at this spacing and offset; ask for fewer steps");
  return timesteps;
}

/// Linear interpolation in `table` at a fractional index, constant past its ends.
double interpolate(const std::vector<double>& table, double index) {
  const double clamped = std::clamp(index, 0.0, static_cast<double>(table.size() - 1));
  const size_t low = std::min(static_cast<size_t>(clamped), table.size() - 2);
  const double fraction = clamped - static_cast<double>(low);
  return table[low] + fraction * (table[low + 1] - table[low]);
}

/// [Karras2022, Eq. 5] with rho = 7, from sigma_max down to sigma_min.
std::vector<double> karras_sigmas(double sigma_max, double sigma_min, int count) {
  constexpr double kRho = 7;
  const double high = std::pow(sigma_max, 1 / kRho), low = std::pow(sigma_min, 1 / kRho);
  std::vector<double> sigmas;
  for (int i = 0; i < count; ++i)
    sigmas.push_back(std::pow(high + (count > 1 ? 1.0 * i / (count - 1) : 0.0) * (low - high), kRho));
  return sigmas;
}

/// The fractional timestep whose sigma is `sigma`, interpolated in log sigma. `table` ascends.
double timestep_of_sigma(const std::vector<double>& table, double sigma) {
  const auto above = std::upper_bound(table.begin(), table.end(), sigma);
  const size_t low =
      std::clamp<ptrdiff_t>(above - table.begin() - 1, 0, static_cast<ptrdiff_t>(table.size()) - 2);
  const double log_low = std::log(table[low]), log_high = std::log(table[low + 1]);
  return static_cast<double>(low) + std::clamp((std::log(sigma) - log_low) / (log_high - log_low), 0.0, 1.0);
}

void fill_sigmas(SchedulePlan& plan) {
  const SchedulerConfig& config = plan.config;
  std::vector<double> table;  // σ of every training timestep, ascending
  for (const double alpha_bar : plan.alphas_cumprod)
    table.push_back(static_cast<double>(static_cast<float>(std::sqrt((1 - alpha_bar) / alpha_bar))));

  for (const double t : plan.timesteps) plan.sigmas.push_back(interpolate(table, t));
  if (config.use_karras_sigmas) {
    // The multistep solvers span the whole training range, Euler what its spacing spans.
    plan.sigmas = is_multistep(config.solver)
                      ? karras_sigmas(table.back(), table.front(), plan.num_steps)
                      : karras_sigmas(plan.sigmas.front(), plan.sigmas.back(), plan.num_steps);
    for (size_t i = 0; i < plan.sigmas.size(); ++i) {
      const double t = timestep_of_sigma(table, plan.sigmas[i]);
      plan.timesteps[i] =
          is_multistep(config.solver) ? std::nearbyint(t) : static_cast<double>(static_cast<float>(t));
    }
  }
  const bool ends_at_zero = is_euler(config.solver) || config.final_sigma == FinalSigma::kZero;
  plan.sigmas.push_back(ends_at_zero ? 0.0 : table.front());
  for (double& sigma : plan.sigmas) sigma = static_cast<double>(static_cast<float>(sigma));

  if (is_euler(config.solver)) {
    const double sigma_max = plan.sigmas.front();
    plan.init_noise_sigma =
        spacing_of(config) == TimestepSpacing::kLeading ? std::sqrt(sigma_max * sigma_max + 1) : sigma_max;
  }
}

void check(const SchedulerConfig& config, int num_steps) {
  const int train = config.num_train_timesteps;
  if (train < 2) refuse("num_train_timesteps is " + std::to_string(train) + ", expected at least 2");
  if (num_steps < 1 || num_steps >= train)
    refuse("steps is " + std::to_string(num_steps) + ", expected 1 to " + std::to_string(train - 1));
  if (config.solver_order < 1 || config.solver_order > 2)
    refuse("solver_order is " + std::to_string(config.solver_order) + ", expected 1 or 2");
  if (config.solver == Solver::kPndm && !config.skip_prk_steps)
    refuse(
        "PNDM with skip_prk_steps = false (Runge-Kutta warm-up) is not supported; choose another scheduler");
  if (config.zero_terminal_snr && config.prediction == Prediction::kEpsilon)
    refuse("rescale_betas_zero_snr with prediction_type epsilon: pure noise predicts no picture");
  if (config.zero_terminal_snr && config.solver == Solver::kPndm)
    refuse("PNDM cannot start from pure noise, as this model does; choose another scheduler");
  if (!config.trained_betas.empty() && config.trained_betas.size() != static_cast<size_t>(train))
    refuse("trained_betas has " + std::to_string(config.trained_betas.size()) + " values, expected " +
           std::to_string(train));
}

}  // namespace

SchedulePlan make_schedule(const SchedulerConfig& config, int num_steps) {
  if (config.refusal) throw *config.refusal;
  check(config, num_steps);
  SchedulePlan plan;
  plan.config = config;
  plan.num_steps = num_steps;
  plan.alphas_cumprod = alphas_cumprod(config);
  plan.timesteps = spaced_timesteps(config, num_steps);
  if (is_euler(config.solver) || is_multistep(config.solver)) fill_sigmas(plan);
  if (config.solver == Solver::kPndm && num_steps > 1)
    plan.timesteps.insert(plan.timesteps.begin() + 1,
                          plan.timesteps[1]);  // the second timestep is called twice
  return plan;
}

int start_index(const SchedulePlan& plan, double strength) {
  // Six decimals are kept: a strength that passed through f32 (0.7f · 20 = 13.9999998) still means its
  // decimal.
  const double decimal = std::round(strength * 1e6) / 1e6;
  if (!(decimal > 0 && decimal <= 1))
    refuse("strength is " + std::to_string(strength) + ", expected above 0 and at most 1");
  const int steps_run = std::min(static_cast<int>(plan.num_steps * decimal), plan.num_steps);
  if (steps_run < 1)
    refuse("strength " + std::to_string(decimal) + " of " + std::to_string(plan.num_steps) +
           " steps leaves none to run; raise the strength or the steps");
  return plan.num_steps - steps_run;
}

}  // namespace patina::diffusion
