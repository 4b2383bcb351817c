#include "patina/diffusion/schedulers/schedulers.h"

#include <cmath>
#include <cstring>
#include <string>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/diffusion/schedulers/common.h"

namespace patina::diffusion {

std::vector<float> combine(std::initializer_list<Term> terms) {
  std::vector<double> sum(terms.begin()->values.size(), 0.0);
  for (const Term& term : terms) {
    if (term.weight == 0) continue;
    PATINA_CHECK_EQ(term.values.size(), sum.size());
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += term.weight * static_cast<double>(term.values[i]);
  }
  return {sum.begin(), sum.end()};
}

std::vector<float> predicted_sample(Prediction prediction, double alpha, double sigma,
                                    std::span<const float> model_output, std::span<const float> x) {
  switch (prediction) {
    case Prediction::kEpsilon:
      return combine({{1 / alpha, x}, {-sigma / alpha, model_output}});
    case Prediction::kV:
      return combine({{alpha, x}, {-sigma, model_output}});
    case Prediction::kSample:
      break;
  }
  return {model_output.begin(), model_output.end()};
}

std::vector<float> scale_model_input(const SchedulePlan& plan, int index, std::span<const float> x) {
  if (plan.config.solver != Solver::kEuler && plan.config.solver != Solver::kEulerAncestral)
    return {x.begin(), x.end()};
  const double sigma = plan.sigmas.at(static_cast<size_t>(index));
  return combine({{1 / std::sqrt(sigma * sigma + 1), x}});
}

namespace {

// Call `index` in the variance-preserving frame: x = alpha x0 + sigma noise.
struct Mixture {
  double alpha, sigma;
};
Mixture mixture_at(const SchedulePlan& plan, int index) {
  const size_t i = static_cast<size_t>(index);
  if (plan.config.solver == Solver::kDdim || plan.config.solver == Solver::kPndm) {
    const double alpha_bar = plan.alphas_cumprod.at(static_cast<size_t>(plan.timesteps.at(i)));
    return {std::sqrt(alpha_bar), std::sqrt(1 - alpha_bar)};
  }
  const NoiseLevel level = noise_level(plan.sigmas.at(i));
  return {level.alpha, level.sigma};
}

}  // namespace

std::vector<float> add_noise(const SchedulePlan& plan, int index, std::span<const float> x0,
                             std::span<const float> noise) {
  if (plan.config.solver == Solver::kEuler || plan.config.solver == Solver::kEulerAncestral)
    return combine({{1, x0}, {plan.sigmas.at(static_cast<size_t>(index)), noise}});
  const Mixture mixture = mixture_at(plan, index);
  return combine({{mixture.alpha, x0}, {mixture.sigma, noise}});
}

std::vector<float> exact_output(const SchedulePlan& plan, int index, std::span<const float> x0,
                                std::span<const float> noise) {
  switch (plan.config.prediction) {
    case Prediction::kEpsilon:
      return {noise.begin(), noise.end()};
    case Prediction::kV: {
      const Mixture mixture = mixture_at(plan, index);
      return combine({{mixture.alpha, noise}, {-mixture.sigma, x0}});
    }
    case Prediction::kSample:
      break;
  }
  return {x0.begin(), x0.end()};
}

bool needs_noise(const SchedulePlan& plan, int index) {
  switch (plan.config.solver) {
    case Solver::kDdim:
      return plan.config.eta > 0;
    case Solver::kEulerAncestral:
      return plan.sigmas.at(static_cast<size_t>(index) + 1) > 0;
    case Solver::kDpmSolverPp:
      return plan.config.dpm_sde && plan.sigmas.at(static_cast<size_t>(index) + 1) > 0;
    case Solver::kPndm:
    case Solver::kEuler:
    case Solver::kUniPc:
      break;
  }
  return false;
}

std::vector<float> step(const SchedulePlan& plan, SchedulerState& state, int index,
                        std::span<const float> model_output, std::span<const float> x,
                        std::span<const float> noise) {
  PATINA_CHECK_LE(0, index);
  PATINA_CHECK_LT(index, plan.num_calls());
  PATINA_CHECK_EQ(model_output.size(), x.size());
  if (needs_noise(plan, index)) PATINA_CHECK_EQ(noise.size(), x.size());
  std::vector<float> next;
  switch (plan.config.solver) {
    case Solver::kDdim:
      next = step_ddim(plan, index, model_output, x, noise);
      break;
    case Solver::kPndm:
      next = step_pndm(plan, state, index, model_output, x);
      break;
    case Solver::kEuler:
    case Solver::kEulerAncestral:
      next = step_euler(plan, index, model_output, x, noise);
      break;
    case Solver::kDpmSolverPp:
      next = step_dpm_solver(plan, state, index, model_output, x, noise);
      break;
    case Solver::kUniPc:
      next = step_unipc(plan, state, index, model_output, x);
      break;
  }
  ++state.calls;
  return next;
}

namespace {

constexpr uint32_t kStateMagic = 0x31435350;  // "PSC1"

void put(std::vector<uint8_t>& bytes, const void* data, size_t size) {
  const auto* first = static_cast<const uint8_t*>(data);
  bytes.insert(bytes.end(), first, first + size);
}

void put_floats(std::vector<uint8_t>& bytes, const std::vector<float>& values) {
  const uint64_t count = values.size();
  put(bytes, &count, sizeof count);
  put(bytes, values.data(), values.size() * sizeof(float));
}

class ByteReader {
 public:
  explicit ByteReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  T value() {
    T result;
    std::memcpy(&result, take(sizeof(T)).data(), sizeof(T));
    return result;
  }
  std::vector<float> floats() {
    const uint64_t count = value<uint64_t>();
    if (count > bytes_.size() / sizeof(float)) fail();
    std::vector<float> result(count);
    if (count > 0) std::memcpy(result.data(), take(count * sizeof(float)).data(), count * sizeof(float));
    return result;
  }
  bool at_end() const { return bytes_.empty(); }
  [[noreturn]] static void fail() {
    throw Error(ErrorCode::kFormat, "scheduler state",
                "is truncated or was written by another version; start anew");
  }

 private:
  std::span<const uint8_t> take(size_t size) {
    if (size > bytes_.size()) fail();
    const auto result = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return result;
  }

  std::span<const uint8_t> bytes_;
};

}  // namespace

std::vector<uint8_t> to_bytes(const SchedulerState& state) {
  std::vector<uint8_t> bytes;
  const uint32_t count = static_cast<uint32_t>(state.history.size());
  put(bytes, &kStateMagic, sizeof kStateMagic);
  put(bytes, &state.calls, sizeof state.calls);
  put(bytes, &state.last_order, sizeof state.last_order);
  put(bytes, &count, sizeof count);
  for (const std::vector<float>& entry : state.history) put_floats(bytes, entry);
  put_floats(bytes, state.last_x);
  return bytes;
}

SchedulerState scheduler_state_from_bytes(std::span<const uint8_t> bytes) {
  ByteReader reader(bytes);
  if (reader.value<uint32_t>() != kStateMagic) ByteReader::fail();
  SchedulerState state;
  state.calls = reader.value<int32_t>();
  state.last_order = reader.value<int32_t>();
  const uint32_t count = reader.value<uint32_t>();
  if (count > 8) ByteReader::fail();  // no solver keeps more than four
  for (uint32_t i = 0; i < count; ++i) state.history.push_back(reader.floats());
  state.last_x = reader.floats();
  if (!reader.at_end()) ByteReader::fail();
  return state;
}

}  // namespace patina::diffusion
