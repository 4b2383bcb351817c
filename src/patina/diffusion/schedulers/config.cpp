// scheduler_config.json -> SchedulerConfig. Absent keys get the default of the class that diffusers
// registers; settings that would change the arithmetic in a way patina does not have are refused by name,
// those of the file's own solver only when that solver runs.
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/diffusion/schedulers/schedulers.h"

namespace patina::diffusion {
namespace {

using Json = nlohmann::json;

/// Typed look-ups in one JSON object; null counts as absent. Errors name the file and the key.
class Reader {
 public:
  Reader(const Json& object, std::string context) : object_(object), context_(std::move(context)) {}

  bool has(const char* key) const { return object_.contains(key) && !object_.at(key).is_null(); }

  double number(const char* key, double absent, double low, double high) const {
    if (!has(key)) return absent;
    const Json& value = object_.at(key);
    if (!value.is_number()) fail(key, "a number");
    const double result = value.get<double>();
    if (!(result >= low && result <= high))
      fail(key, "a number from " + std::to_string(low) + " to " + std::to_string(high));
    return result;
  }
  int integer(const char* key, int absent, int low, int high) const {
    if (has(key) && !object_.at(key).is_number_integer()) fail(key, "an integer");
    return static_cast<int>(number(key, absent, low, high));
  }
  bool boolean(const char* key, bool absent) const {
    if (!has(key)) return absent;
    if (!object_.at(key).is_boolean()) fail(key, "true or false");
    return object_.at(key).get<bool>();
  }
  /// The value that belongs to the string found, from pairs of string and value.
  template <class T>
  T choice(const char* key, T absent, std::initializer_list<std::pair<const char*, T>> choices) const {
    if (!has(key)) return absent;
    std::string names;
    for (const auto& [name, value] : choices) {
      if (object_.at(key) == name) return value;
      names += std::string(names.empty() ? "" : ", ") + name;
    }
    throw Error(
        ErrorCode::kUnsupported, context_,
        std::string(key) + " is " + printable(object_.at(key).dump()) + ", expected one of: " + names);
  }
  /// Refuses a feature that is switched on.
  void refuse_if(bool on, const char* key) const {
    if (on)
      throw Error(ErrorCode::kUnsupported, context_,
                  std::string(key) + " is set to a value that patina does not support");
  }
  [[noreturn]] void fail(const char* key, const std::string& expected) const {
    throw Error(ErrorCode::kFormat, context_,
                std::string(key) + " is " + printable(object_.at(key).dump()) + ", expected " + expected);
  }
  const Json& at(const char* key) const { return object_.at(key); }

 private:
  const Json& object_;
  std::string context_;
};

std::vector<float> read_trained_betas(const Reader& reader, int count) {
  std::vector<float> betas;
  if (!reader.has("trained_betas")) return betas;
  const Json& list = reader.at("trained_betas");
  const std::string expected = "a list of " + std::to_string(count) + " numbers in (0,1)";
  if (!list.is_array() || list.size() != static_cast<size_t>(count)) reader.fail("trained_betas", expected);
  for (const Json& entry : list) {
    if (!entry.is_number() || !(entry.get<double>() > 0 && entry.get<double>() < 1))
      reader.fail("trained_betas", expected);
    betas.push_back(entry.get<float>());
  }
  return betas;
}

/// The solver of `_class_name`; none for a class that patina lacks, whose noise schedule can still be used.
std::optional<Solver> named_solver(const Json& object) {
  const std::pair<const char*, Solver> names[] = {
      {"DDIMScheduler", Solver::kDdim},
      {"PNDMScheduler", Solver::kPndm},
      {"EulerDiscreteScheduler", Solver::kEuler},
      {"EulerAncestralDiscreteScheduler", Solver::kEulerAncestral},
      {"DPMSolverMultistepScheduler", Solver::kDpmSolverPp},
      {"UniPCMultistepScheduler", Solver::kUniPc},
  };
  for (const auto& [name, solver] : names)
    if (object.contains("_class_name") && object.at("_class_name") == name) return solver;
  return std::nullopt;
}

Solver solver_of(Scheduler choice) {
  switch (choice) {
    case Scheduler::kDdim:
      return Solver::kDdim;
    case Scheduler::kPndm:
      return Solver::kPndm;
    case Scheduler::kEuler:
      return Solver::kEuler;
    case Scheduler::kEulerAncestral:
      return Solver::kEulerAncestral;
    case Scheduler::kDpmSolverPp2m:
    case Scheduler::kDpmSolverPp2mKarras:
      return Solver::kDpmSolverPp;
    case Scheduler::kUniPc:
      break;
  }
  return Solver::kUniPc;
}

void refuse_unsupported(const Reader& reader, const SchedulerConfig& config) {
  reader.refuse_if(reader.boolean("thresholding", false), "thresholding");
  reader.refuse_if(reader.boolean("use_lu_lambdas", false), "use_lu_lambdas");
  reader.refuse_if(reader.boolean("use_exponential_sigmas", false), "use_exponential_sigmas");
  reader.refuse_if(reader.boolean("use_beta_sigmas", false), "use_beta_sigmas");
  reader.refuse_if(reader.boolean("euler_at_final", false), "euler_at_final");
  reader.refuse_if(!reader.boolean("predict_x0", true), "predict_x0");
  reader.refuse_if(reader.has("disable_corrector") && !reader.at("disable_corrector").empty(),
                   "disable_corrector");
  reader.refuse_if(reader.has("solver_p"), "solver_p");
  reader.refuse_if(reader.has("sigma_min"), "sigma_min");
  reader.refuse_if(reader.has("sigma_max"), "sigma_max");
  reader.refuse_if(reader.has("interpolation_type") && reader.at("interpolation_type") != "linear",
                   "interpolation_type");
  reader.refuse_if(reader.has("timestep_type") && reader.at("timestep_type") != "discrete", "timestep_type");
  reader.refuse_if(reader.has("variance_type") && config.solver == Solver::kDpmSolverPp, "variance_type");
}

/// The noise schedule, the prediction and what else every solver takes from the model.
void read_schedule(SchedulerConfig& config, const Reader& reader) {
  const bool ddim = config.solver == Solver::kDdim;
  config.num_train_timesteps = reader.integer("num_train_timesteps", 1000, 2, 1'000'000);
  config.beta_start = reader.number("beta_start", 1e-4, 1e-12, 0.999);
  config.beta_end = reader.number("beta_end", 0.02, 1e-12, 0.999);
  config.beta_schedule = reader.choice("beta_schedule", BetaSchedule::kLinear,
                                       {{"linear", BetaSchedule::kLinear},
                                        {"scaled_linear", BetaSchedule::kScaledLinear},
                                        {"squaredcos_cap_v2", BetaSchedule::kSquaredCosine}});
  config.trained_betas = read_trained_betas(reader, config.num_train_timesteps);
  config.zero_terminal_snr = reader.boolean("rescale_betas_zero_snr", false);
  config.prediction = reader.choice(
      "prediction_type", Prediction::kEpsilon,
      {{"epsilon", Prediction::kEpsilon}, {"v_prediction", Prediction::kV}, {"sample", Prediction::kSample}});
  if (reader.has("timestep_spacing"))
    config.spacing = reader.choice("timestep_spacing", TimestepSpacing::kLeading,
                                   {{"leading", TimestepSpacing::kLeading},
                                    {"trailing", TimestepSpacing::kTrailing},
                                    {"linspace", TimestepSpacing::kLinspace}});
  config.steps_offset = reader.integer("steps_offset", 0, 0, config.num_train_timesteps - 1);
  config.set_alpha_to_one = reader.boolean("set_alpha_to_one", ddim);
  config.clip_sample = reader.boolean("clip_sample", ddim);
  config.clip_sample_range = reader.number("clip_sample_range", 1.0, 1e-12, 1e12);
  config.use_karras_sigmas = reader.boolean("use_karras_sigmas", false);
  config.final_sigma = reader.choice("final_sigmas_type", FinalSigma::kZero,
                                     {{"zero", FinalSigma::kZero}, {"sigma_min", FinalSigma::kSigmaMin}});
}

/// What only the class named in the file makes use of. Throws Error for a setting that patina lacks.
void read_own_settings(SchedulerConfig& config, const Reader& reader) {
  config.solver_order = reader.integer("solver_order", 2, 1, 2);
  if (config.solver == Solver::kDpmSolverPp) {
    config.dpm_sde =
        reader.choice("algorithm_type", false, {{"dpmsolver++", false}, {"sde-dpmsolver++", true}});
    config.dpm_variant = reader.choice("solver_type", DpmVariant::kMidpoint,
                                       {{"midpoint", DpmVariant::kMidpoint}, {"heun", DpmVariant::kHeun}});
  }
  if (config.solver == Solver::kUniPc)
    config.unipc_variant = reader.choice("solver_type", UniPcVariant::kBh2,
                                         {{"bh1", UniPcVariant::kBh1}, {"bh2", UniPcVariant::kBh2}});
  refuse_unsupported(reader, config);
}

}  // namespace

SchedulerConfig parse_scheduler_config(std::string_view json, std::string_view context) {
  const Json object = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  if (!object.is_object())
    throw Error(ErrorCode::kFormat, context, "is not a JSON object; expected a scheduler configuration");
  const Reader reader(object, std::string(context));

  SchedulerConfig config;
  const std::optional<Solver> named = named_solver(object);
  config.solver = named.value_or(Solver::kUniPc);
  read_schedule(config, reader);
  config.skip_prk_steps = reader.boolean("skip_prk_steps", named != Solver::kPndm);
  config.lower_order_final = reader.boolean("lower_order_final", true);
  if (named) {
    try {
      read_own_settings(config, reader);
    } catch (const Error& error) {
      config.refusal = error;
    }
  }
  return config;
}

SchedulerConfig choose_scheduler(const SchedulerConfig& model, Scheduler choice) {
  SchedulerConfig config = model;
  config.solver = solver_of(choice);
  if (config.solver != model.solver) config.refusal.reset();  // of settings that are not used then
  if (choice == Scheduler::kDpmSolverPp2m || choice == Scheduler::kDpmSolverPp2mKarras)
    config.use_karras_sigmas = choice == Scheduler::kDpmSolverPp2mKarras;
  return config;
}

}  // namespace patina::diffusion
