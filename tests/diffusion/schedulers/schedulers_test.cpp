// Schedulers against trajectories of the reference implementation (tests/data/golden/schedulers holds one or
// two variants a class, the shared folder all), and what must hold of any of them.
#include "patina/diffusion/schedulers/schedulers.h"

#include <cmath>
#include <cstring>
#include <string>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/nn/safetensors.h"
#include "support.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

fs::path local_folder() {
  return test::data_dir() / "golden" / "schedulers";
}

const Json& golden_index() {
  static const Json index = Json::parse(read_text_file(local_folder() / "index.json"));
  return index;
}

struct Golden {
  std::vector<int64_t> shape;
  std::vector<double> values;  // [shape]

  /// Slice i along the first axis.
  std::vector<float> row(size_t i) const {
    const size_t size = values.size() / static_cast<size_t>(shape.at(0));
    return {values.begin() + static_cast<ptrdiff_t>(i * size),
            values.begin() + static_cast<ptrdiff_t>((i + 1) * size)};
  }
  std::vector<float> all() const { return {values.begin(), values.end()}; }
  double max_abs() const {
    double result = 0;
    for (const double value : values) result = std::max(result, std::abs(value));
    return result;
  }
};

Golden load(const nn::SafeTensors& file, const std::string& name) {
  const nn::TensorEntry* entry = file.find(name);
  if (!entry) throw std::runtime_error("golden file lacks " + name);
  Golden result{entry->shape, {}};
  const auto append = [&]<class T>(T) {
    for (size_t at = 0; at + sizeof(T) <= entry->bytes.size(); at += sizeof(T)) {
      T value;
      std::memcpy(&value, entry->bytes.data() + at, sizeof value);
      result.values.push_back(static_cast<double>(value));
    }
  };
  if (entry->type == nn::ElementType::kI64)
    append(int64_t{});
  else
    append(float{});
  return result;
}

void expect_close(std::span<const float> found, std::span<const float> expected, double limit,
                  const std::string& what) {
  ASSERT_EQ(found.size(), expected.size()) << what;
  for (size_t i = 0; i < found.size(); ++i)
    ASSERT_NEAR(found[i], expected[i], limit) << what << " at element " << i;
}

SchedulerConfig config_of(const Json& variant) {
  Json values = variant.at("config");
  values["_class_name"] = variant.at("class");
  SchedulerConfig config = parse_scheduler_config(values.dump(), "index.json");
  config.eta = variant.at("overrides").value("_eta", 0.0);
  // diffusers 0.27 has no such setting for UniPC and ends at sigma_min.
  if (config.solver == Solver::kUniPc && variant.at("reference") == "diffusers 0.27.2")
    config.final_sigma = FinalSigma::kSigmaMin;
  return config;
}

/// The golden latents were stored in f32 by a reference that keeps its tables in f32: its own f64 rerun
/// differs by 3e-6 of the largest value.
constexpr double kRelativeLimit = 1e-5;

class SchedulerGolden : public testing::TestWithParam<std::string> {};

TEST_P(SchedulerGolden, follows_reference_trajectories) {
  const Json& variant = golden_index().at(GetParam());
  const std::string file_name = variant.at("file").get<std::string>();
  fs::path path = local_folder() / file_name;
  if (!fs::exists(path)) {
    PATINA_REQUIRE_SHARED("golden/golden/schedulers/" + file_name);
    path = test::shared_dir() / "golden/golden/schedulers" / file_name;
  }
  const nn::SafeTensors file(path), inputs(local_folder() / "inputs.safetensors");
  const Golden outputs = load(inputs, "model_outputs"), noises = load(inputs, "step_noises");
  const std::vector<float> init_noise = load(inputs, "init_noise").all(), x0 = load(inputs, "x0").all();
  const SchedulerConfig config = config_of(variant);

  for (const auto& [run, facts] : variant.at("runs").items()) {
    SCOPED_TRACE(run);
    const bool from_image = run.starts_with("img2img");
    const int num_steps = std::stoi(run.substr(from_image ? 7 : 5));
    const SchedulePlan plan = make_schedule(config, num_steps);
    const int start = from_image ? start_index(plan, std::stod(run.substr(run.find("strength") + 8))) : 0;
    const size_t first = static_cast<size_t>(start);

    const Golden timesteps = load(file, run + "/timesteps");
    ASSERT_EQ(timesteps.values.size(), plan.timesteps.size() - first);
    for (size_t i = 0; i < timesteps.values.size(); ++i)
      EXPECT_NEAR(plan.timesteps[first + i], timesteps.values[i], 1e-5 * 999) << "timestep " << i;
    if (file.find(run + "/sigmas")) {
      const Golden sigmas = load(file, run + "/sigmas");
      ASSERT_EQ(sigmas.values.size(), plan.sigmas.size());
      for (size_t i = 0; i < sigmas.values.size(); ++i)
        EXPECT_NEAR(plan.sigmas[i], sigmas.values[i], 2e-6 * sigmas.values[i]) << "sigma " << i;
    }

    std::vector<float> x;
    if (from_image) {
      x = add_noise(plan, start, x0, init_noise);
      const Golden noisy = load(file, run + "/noisy");
      expect_close(x, noisy.all(), kRelativeLimit * noisy.max_abs(), "add_noise");
    } else {
      EXPECT_NEAR(plan.init_noise_sigma, facts.at("init_noise_sigma").get<double>(),
                  1e-6 * plan.init_noise_sigma);
      for (const float value : init_noise) x.push_back(static_cast<float>(value * plan.init_noise_sigma));
    }
    if (!file.find(run + "/latents")) continue;

    const Golden latents = load(file, run + "/latents");
    ASSERT_EQ(static_cast<size_t>(latents.shape[0]), plan.timesteps.size() - first + 1);
    const bool has_scaled = file.find(run + "/scaled_input") != nullptr;
    SchedulerState state;
    for (size_t call = 0; call + first < plan.timesteps.size(); ++call) {
      const int index = start + static_cast<int>(call);
      if (has_scaled) {
        const Golden scaled = load(file, run + "/scaled_input");
        expect_close(scale_model_input(plan, index, x), scaled.row(call), kRelativeLimit * scaled.max_abs(),
                     "scaled input of call " + std::to_string(call));
      }
      const std::vector<float> noise = needs_noise(plan, index) ? noises.row(call) : std::vector<float>{};
      // A round trip through bytes at every step: a resumed run cannot differ.
      state = scheduler_state_from_bytes(to_bytes(state));
      x = step(plan, state, index, outputs.row(call), x, noise);
      expect_close(x, latents.row(call + 1), kRelativeLimit * latents.max_abs(),
                   "latents after call " + std::to_string(call));
    }
  }
}

std::vector<std::string> golden_names() {
  std::vector<std::string> names;
  for (const auto& [name, variant] : golden_index().items()) names.push_back(name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(All, SchedulerGolden, testing::ValuesIn(golden_names()), [](const auto& test_info) {
  std::string name = test_info.param;
  for (char& c : name)
    if (c == '.') c = '_';
  return name;
});

TEST(Schedulers, alphas_equal_the_reference_table) {
  const nn::SafeTensors inputs(local_folder() / "inputs.safetensors");
  const Golden expected = load(inputs, "alphas_cumprod");
  const SchedulePlan plan = make_schedule({}, 20);
  ASSERT_EQ(plan.alphas_cumprod.size(), expected.values.size());
  for (size_t i = 0; i < expected.values.size(); ++i)
    EXPECT_NEAR(plan.alphas_cumprod[i], expected.values[i], 1e-6 * expected.values[i]) << i;
}

const Solver kSolvers[] = {Solver::kDdim,           Solver::kPndm,        Solver::kEuler,
                           Solver::kEulerAncestral, Solver::kDpmSolverPp, Solver::kUniPc};

// A network that always knows the true sample must be led to it: the largest difference in the end.
double distance_from_truth(const SchedulerConfig& config, double strength) {
  const std::vector<float> truth{0.5f, -1.25f, 2.0f, 0.0f};
  const SchedulePlan plan = make_schedule(config, 25);
  const int start = start_index(plan, strength);
  std::vector<float> x = add_noise(plan, start, truth, std::vector<float>{1.0f, -0.5f, 0.25f, 2.0f});
  SchedulerState state;
  for (int i = start; i < plan.num_calls(); ++i) {
    const std::vector<float> input = scale_model_input(plan, i, x);
    double alpha_bar = 0;
    if (plan.sigmas.empty()) {
      alpha_bar = plan.alphas_cumprod[static_cast<size_t>(plan.timesteps[static_cast<size_t>(i)])];
    } else {
      const double sigma = plan.sigmas[static_cast<size_t>(i)];
      alpha_bar = 1 / (1 + sigma * sigma);
    }
    const double a = std::sqrt(alpha_bar), s = std::sqrt(1 - alpha_bar);
    std::vector<float> output(truth.size());
    for (size_t e = 0; e < truth.size(); ++e) {
      const double epsilon = (static_cast<double>(input[e]) - a * truth[e]) / s;
      output[e] = static_cast<float>(config.prediction == Prediction::kEpsilon ? epsilon
                                     : config.prediction == Prediction::kV     ? a * epsilon - s * truth[e]
                                                                               : truth[e]);
    }
    x = step(plan, state, i, output, x, std::vector<float>{0.1f, -0.2f, 0.3f, -0.4f});
  }
  double distance = 0;
  for (size_t e = 0; e < truth.size(); ++e)
    distance = std::max(distance, static_cast<double>(std::abs(x[e] - truth[e])));
  return distance;
}

TEST(Schedulers, perfect_prediction_recovers_the_sample) {
  for (const Solver solver : kSolvers)
    for (const Prediction prediction : {Prediction::kEpsilon, Prediction::kV, Prediction::kSample})
      for (const TimestepSpacing spacing :
           {TimestepSpacing::kLeading, TimestepSpacing::kTrailing, TimestepSpacing::kLinspace})
        for (const BetaSchedule schedule :
             {BetaSchedule::kLinear, BetaSchedule::kScaledLinear, BetaSchedule::kSquaredCosine}) {
          SchedulerConfig config;
          config.solver = solver;
          config.prediction = prediction;
          config.spacing = spacing;
          config.beta_schedule = schedule;
          config.set_alpha_to_one = true;
          // PNDM extrapolates its outputs, which a network that knows the truth changes from step to step.
          EXPECT_LT(distance_from_truth(config, 0.6), solver == Solver::kPndm ? 0.1 : 1e-5)
              << "solver " << static_cast<int>(solver) << " prediction " << static_cast<int>(prediction)
              << " spacing " << static_cast<int>(spacing) << " schedule " << static_cast<int>(schedule);
        }
}

// Values of diffusers' DDIMScheduler(rescale_betas_zero_snr=True) and Stable Diffusion's betas.
TEST(Schedulers, zero_terminal_snr_ends_in_pure_noise) {
  SchedulerConfig config = parse_scheduler_config(
      R"({"_class_name":"DDIMScheduler","beta_start":0.00085,"beta_end":0.012,"beta_schedule":"scaled_linear",
          "clip_sample":false,"prediction_type":"v_prediction","timestep_spacing":"trailing","rescale_betas_zero_snr":true})",
      "scheduler_config.json");
  const SchedulePlan plan = make_schedule(config, 20);
  const std::pair<size_t, double> expected[] = {
      {0, 0.999149978}, {250, 0.65245676}, {500, 0.241018638}, {750, 0.03279908}, {900, 0.00296039134}};
  for (const auto& [t, alpha_bar] : expected)
    EXPECT_NEAR(plan.alphas_cumprod[t], alpha_bar, 2e-6 * alpha_bar) << t;
  EXPECT_EQ(plan.alphas_cumprod[999], 0.0);
  EXPECT_EQ(plan.timesteps.front(), 999);
  const std::vector<float> noise{1.0f, -0.5f};
  EXPECT_EQ(add_noise(plan, 0, std::vector<float>{30.0f, 20.0f}, noise), noise);

  config.set_alpha_to_one = true;
  for (const Solver solver : kSolvers)
    for (const Prediction prediction : {Prediction::kV, Prediction::kSample})
      for (const double strength : {1.0, 0.6}) {
        config.solver = solver, config.prediction = prediction;
        if (solver == Solver::kPndm) {
          EXPECT_THROW(make_schedule(config, 25), Error);
          continue;
        }
        EXPECT_LT(distance_from_truth(config, strength), 1e-4)
            << "solver " << static_cast<int>(solver) << " prediction " << static_cast<int>(prediction)
            << " strength " << strength;
      }
  config.solver = Solver::kDdim, config.prediction = Prediction::kEpsilon;
  EXPECT_THROW(make_schedule(config, 20), Error);
}

TEST(Schedulers, strength_keeps_the_last_steps) {
  const SchedulePlan plan = make_schedule({}, 20);
  EXPECT_EQ(start_index(plan, 1.0), 0);
  EXPECT_EQ(start_index(plan, 0.8), 4);
  EXPECT_EQ(start_index(plan, 0.7f), 6);  // 0.7f · 20 is 13.9999998
  EXPECT_EQ(start_index(plan, 0.05), 19);
  EXPECT_THROW(start_index(plan, 0.04), Error);
  EXPECT_THROW(start_index(plan, 0.0), Error);
  EXPECT_THROW(start_index(plan, 1.01), Error);
  EXPECT_THROW(start_index(plan, std::nan("")), Error);
}

TEST(Schedulers, step_counts_out_of_range_are_refused) {
  for (const Solver solver : kSolvers) {
    SchedulerConfig config;
    config.solver = solver;
    EXPECT_THROW(make_schedule(config, 0), Error);
    EXPECT_THROW(make_schedule(config, -3), Error);
    EXPECT_THROW(make_schedule(config, 1000), Error);
    for (const int steps : {1, 2, 3}) {
      const SchedulePlan plan = make_schedule(config, steps);
      SchedulerState state;
      std::vector<float> x{1.0f, -1.0f};
      for (int i = 0; i < plan.num_calls(); ++i)
        x = step(plan, state, i, std::vector<float>{0.3f, 0.2f}, x, std::vector<float>{1.0f, 0.0f});
      for (const float value : x)
        EXPECT_TRUE(std::isfinite(value)) << static_cast<int>(solver) << " steps " << steps;
    }
  }
}

TEST(Schedulers, choosing_another_scheduler_keeps_the_model_and_takes_the_default_spacing) {
  const SchedulerConfig model = parse_scheduler_config(
      R"({"_class_name":"PNDMScheduler","beta_start":0.00085,"beta_end":0.012,"beta_schedule":"scaled_linear",
          "num_train_timesteps":1000,"skip_prk_steps":true,"steps_offset":1,"set_alpha_to_one":false,"trained_betas":null})",
      "scheduler_config.json");
  const SchedulerConfig chosen = choose_scheduler(model, Scheduler::kDpmSolverPp2mKarras);
  EXPECT_EQ(chosen.solver, Solver::kDpmSolverPp);
  EXPECT_TRUE(chosen.use_karras_sigmas);
  EXPECT_EQ(chosen.beta_schedule, BetaSchedule::kScaledLinear);
  EXPECT_EQ(make_schedule(choose_scheduler(model, Scheduler::kDdim), 20).timesteps.front(), 951);
  EXPECT_EQ(make_schedule(choose_scheduler(model, Scheduler::kUniPc), 20).timesteps.front(), 999);
}

TEST(Schedulers, configurations_that_change_the_arithmetic_are_refused_by_name) {
  const auto message = [](const char* json) -> std::string {
    try {
      make_schedule(parse_scheduler_config(json, "scheduler_config.json"), 20);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message(R"({"_class_name":"DDIMScheduler","thresholding":true})").find("thresholding"),
            std::string::npos);
  EXPECT_NE(message(R"({"_class_name":"DDIMScheduler","beta_start":"x"})").find("beta_start"),
            std::string::npos);
  EXPECT_NE(message(R"({"_class_name":"UniPCMultistepScheduler","solver_order":3})").find("solver_order"),
            std::string::npos);
  EXPECT_NE(message(R"({"num_train_timesteps":-1})").find("num_train_timesteps"), std::string::npos);
  EXPECT_NE(message("[1, 2").find("JSON"), std::string::npos);
}

// As published for models that were trained to predict v.
TEST(Schedulers, settings_of_the_models_own_solver_do_not_stop_another) {
  const SchedulerConfig model = parse_scheduler_config(
      R"({"_class_name":"DPMSolverMultistepScheduler","beta_start":0.00085,"beta_end":0.012,
          "beta_schedule":"scaled_linear","prediction_type":"v_prediction","timestep_spacing":"trailing",
          "rescale_betas_zero_snr":true,"solver_order":3,"algorithm_type":"dpmsolver"})",
      "scheduler_config.json");
  const SchedulerConfig chosen = choose_scheduler(model, Scheduler::kDdim);
  EXPECT_EQ(make_schedule(chosen, 20).timesteps.front(), 999);
  EXPECT_EQ(chosen.prediction, Prediction::kV);
  EXPECT_TRUE(chosen.zero_terminal_snr);
  EXPECT_EQ(chosen.solver_order, 2);
  EXPECT_THROW(make_schedule(choose_scheduler(model, Scheduler::kDpmSolverPp2m), 20), Error);
}

TEST(Schedulers, a_class_that_patina_lacks_lends_its_noise_schedule_to_unipc) {
  const SchedulerConfig config = parse_scheduler_config(
      R"({"_class_name":"DEISMultistepScheduler","beta_start":0.001,"solver_type":"logrho","solver_order":3})",
      "scheduler_config.json");
  EXPECT_EQ(config.solver, Solver::kUniPc);
  EXPECT_EQ(config.beta_start, 0.001);
  EXPECT_EQ(config.solver_order, 2);
}

TEST(Schedulers, pndm_with_runge_kutta_warm_up_is_refused_when_it_would_run) {
  const SchedulerConfig config =
      parse_scheduler_config(R"({"_class_name":"PNDMScheduler"})", "scheduler_config.json");
  EXPECT_THROW(make_schedule(config, 20), Error);
  EXPECT_NO_THROW(make_schedule(choose_scheduler(config, Scheduler::kUniPc), 20));
}

TEST(Schedulers, damaged_state_is_refused) {
  SchedulerState state;
  state.calls = 3;
  state.history = {{1, 2, 3}, {4, 5, 6}};
  state.last_x = {7, 8, 9};
  const std::vector<uint8_t> bytes = to_bytes(state);
  EXPECT_EQ(scheduler_state_from_bytes(bytes), state);
  for (size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(scheduler_state_from_bytes(std::span(bytes).first(size)), Error) << size;
}

}  // namespace
}  // namespace patina::diffusion
