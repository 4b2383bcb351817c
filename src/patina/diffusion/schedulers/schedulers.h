// Diffusion schedulers: from a noisy latent and the network's output to the next, less noisy one. Torch-free:
// latents are spans of f32. Defined as huggingface diffusers 0.27 defines them, against whose trajectories
// they are tested.
//
//   plan = make_schedule(config, steps);  x = add_noise(plan, start_index(plan, strength), x0, noise);
//   for i in [start, plan.num_calls()):  x = step(plan, state, i, network(scale_model_input(plan, i, x),
//   plan.timesteps[i]), x, noise_i);
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "patina/base/error.h"
#include "patina/diffusion/options.h"

namespace patina::diffusion {

enum class Solver { kDdim, kPndm, kEuler, kEulerAncestral, kDpmSolverPp, kUniPc };
enum class BetaSchedule { kLinear, kScaledLinear, kSquaredCosine };
enum class Prediction { kEpsilon, kV, kSample };  // what the network's output means
enum class TimestepSpacing { kLeading, kTrailing, kLinspace };
enum class FinalSigma { kZero, kSigmaMin };
enum class DpmVariant { kMidpoint, kHeun };
enum class UniPcVariant { kBh1, kBh2 };

/// The values of scheduler_config.json. Defaults are Stable Diffusion 1.5's.
struct SchedulerConfig {
  Solver solver = Solver::kPndm;
  int num_train_timesteps = 1000;
  double beta_start = 0.00085, beta_end = 0.012;
  BetaSchedule beta_schedule = BetaSchedule::kScaledLinear;
  std::vector<float> trained_betas;  // [num_train_timesteps], replaces the formula; empty: none
  bool zero_terminal_snr = false;    // the last timestep is pure noise (rescale_betas_zero_snr) [Lin2024]
  Prediction prediction = Prediction::kEpsilon;
  std::optional<TimestepSpacing> spacing;  // nullopt: leading for DDIM and PNDM, linspace for the others
  int steps_offset = 1;                    // added to the timesteps of `leading`
  bool set_alpha_to_one = false;           // DDIM, PNDM: ᾱ past the last step is 1 instead of ᾱ_0
  bool skip_prk_steps = true;  // PNDM: without Runge-Kutta warm-up; false is refused by make_schedule
  bool clip_sample = false;    // DDIM: clamp the predicted sample to ±clip_sample_range
  double clip_sample_range = 1.0;
  double eta = 0.0;                // DDIM: 0 deterministic, 1 ancestral [Song2021]
  bool use_karras_sigmas = false;  // Euler, DPM-Solver++, UniPC [Karras2022, Eq. 5]
  FinalSigma final_sigma =
      FinalSigma::kZero;          // DPM-Solver++, UniPC (diffusers before 0.28: UniPC ended at sigma_min)
  int solver_order = 2;           // DPM-Solver++, UniPC: 1 or 2
  bool lower_order_final = true;  // DPM-Solver++: only below 15 steps; UniPC: always
  DpmVariant dpm_variant = DpmVariant::kMidpoint;
  bool dpm_sde = false;  // DPM-Solver++ as a stochastic equation: draws noise each step
  UniPcVariant unipc_variant = UniPcVariant::kBh2;
  std::optional<Error> refusal;  // of a setting of `solver` that patina lacks; make_schedule throws it
};

/// Reads the text of a scheduler_config.json; `context` (its path) goes into errors. Keys that are absent get
/// diffusers' default of the class; a class that patina lacks is read for its noise schedule and gets UniPC.
/// Throws Error{kFormat} for values of the wrong type or range, Error{kUnsupported} naming a setting patina
/// lacks; such a fault in a setting of the class itself becomes the configuration's `refusal`.
SchedulerConfig parse_scheduler_config(std::string_view json, std::string_view context);

/// The model's configuration (betas, prediction, offsets) under the scheduler the user chose, with that
/// scheduler's default spacing unless `model` gives one explicitly.
SchedulerConfig choose_scheduler(const SchedulerConfig& model, Scheduler choice);

/// Everything about one run that does not depend on the latents.
struct SchedulePlan {
  SchedulerConfig config;
  int num_steps = 0;
  std::vector<double> alphas_cumprod;  // ᾱ [num_train_timesteps], f32 values
  std::vector<double>
      timesteps;  // one a network call, descending; PNDM has num_steps + 1 (its first is run twice)
  std::vector<double> sigmas;  // [timesteps + 1], f32 values, σ = √((1 - ᾱ)/ᾱ); empty for DDIM and PNDM
  double init_noise_sigma = 1;  // scale of the noise that text-to-image starts from

  int num_calls() const { return static_cast<int>(timesteps.size()); }
};

/// Throws the configuration's refusal if it has one, Error{kUsage} unless 1 <= num_steps <
/// num_train_timesteps and the settings fit together.
SchedulePlan make_schedule(const SchedulerConfig& config, int num_steps);

/// Index of the first timestep of image-to-image at `strength` in (0,1]: the last int(num_steps · strength)
/// steps are run [Meng2022]. Throws Error{kUsage} if that leaves no step.
int start_index(const SchedulePlan& plan, double strength);

/// All that is carried from one step to the next. A new run, from whatever index, starts with a fresh one.
struct SchedulerState {
  int32_t calls = 0;                        // steps made since the start
  int32_t last_order = 0;                   // UniPC: order of the last predictor step
  std::vector<std::vector<float>> history;  // earlier model outputs (PNDM) or predicted samples, newest last
  std::vector<float> last_x;  // UniPC: the latent the last step started from; PNDM: that of the first call

  bool operator==(const SchedulerState&) const = default;
};
std::vector<uint8_t> to_bytes(const SchedulerState& state);
/// Throws Error{kFormat} if `bytes` is not what to_bytes made.
SchedulerState scheduler_state_from_bytes(std::span<const uint8_t> bytes);

/// What the network is given at call `index`: x / √(σ² + 1) for the Euler solvers, x itself for the others.
std::vector<float> scale_model_input(const SchedulePlan& plan, int index, std::span<const float> x);

/// x0 brought to the noise level of timestep `index`.
std::vector<float> add_noise(const SchedulePlan& plan, int index, std::span<const float> x0,
                             std::span<const float> noise);

/// What a network would say at call `index` that knew x0 and the noise, in the terms of the configuration's
/// prediction. Steps with it lead to x0.
std::vector<float> exact_output(const SchedulePlan& plan, int index, std::span<const float> x0,
                                std::span<const float> noise);

/// Whether step(index) adds fresh unit-variance noise.
bool needs_noise(const SchedulePlan& plan, int index);

/// The latent after call `index`. Calls go up one by one from the start. `x` is the unscaled latent, `noise`
/// may be empty where needs_noise is false. All spans have one length. `state` is advanced.
std::vector<float> step(const SchedulePlan& plan, SchedulerState& state, int index,
                        std::span<const float> model_output, std::span<const float> x,
                        std::span<const float> noise = {});

}  // namespace patina::diffusion
