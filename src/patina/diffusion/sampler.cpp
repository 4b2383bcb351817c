#include "patina/diffusion/sampler.h"

#include <algorithm>
#include <cstring>

#include <ATen/ATen.h>

#include "patina/base/check.h"
#include "patina/base/error.h"

namespace patina::diffusion {
namespace {

constexpr uint32_t kStateMagic = 0x31545350;  // "PST1"

std::span<const float> values_of(const at::Tensor& tensor) {
  return {tensor.data_ptr<float>(), static_cast<size_t>(tensor.numel())};
}

}  // namespace

Guided Denoiser::operator()(const at::Tensor& latents, double timestep,
                            std::span<const at::Tensor> noised) const {
  PATINA_CHECK(text.tokens.size(0) == (guidance_scale == 1 ? 1 : 2));
  const at::Tensor timesteps = at::full({1}, timestep, at::kFloat);
  std::vector<NetworkInputs> evaluations;
  for (TextConditioning& prompts : split_prompts(text, one_batch ? 2 : 1)) {
    const at::Tensor samples = latents.expand({prompts.tokens.size(0), -1, -1, -1});
    evaluations.push_back({samples, timesteps, std::move(prompts), bias});
    evaluations.back().part_levels = part_levels ? &*part_levels : nullptr;
  }
  for (const TextConditioning& part : part_texts) {
    const std::vector<TextConditioning> groups = split_prompts(part, one_batch ? 2 : 1);
    for (size_t i = 0; i < evaluations.size(); ++i) evaluations[i].part_texts.push_back(groups[i]);
  }

  // What the references' self-attentions see; the evaluation without the prompt does without.
  PATINA_CHECK_EQ(noised.size(), references.size());
  std::vector<ReferenceTokens> tokens(references.size());
  for (size_t i = 0; i < references.size(); ++i) {
    (*unet)({noised[i], timesteps, references[i].text}, {}, record_reference(tokens[i]));
    evaluations.back().references.push_back({&tokens[i], &references[i].weights});
  }

  // ControlNets outside: with little memory each is read from its file for this loop.
  std::vector<ControlResiduals> residuals(evaluations.size());
  for (const Control& control : controls) {
    if (control.scale == 0) continue;
    const std::shared_ptr<const ControlNet> network = control.network->use();
    for (size_t i = 0; i < evaluations.size(); ++i) {
      NetworkInputs inputs = evaluations[i];
      if (!bias_controls) inputs.bias = nullptr;
      inputs.references.clear();
      residuals[i] = sum(std::move(residuals[i]), (*network)(inputs, control.hint, control.scale));
    }
  }
  std::vector<at::Tensor> outputs;
  for (size_t i = 0; i < evaluations.size(); ++i)
    outputs.push_back((*unet)(evaluations[i], std::move(residuals[i]), record));
  const at::Tensor out = at::cat(outputs).to(at::kCPU, at::kFloat).contiguous();
  if (guidance_scale == 1) return {out, out, out};
  const at::Tensor unconditional = out.slice(0, 0, 1), conditional = out.slice(0, 1, 2);
  return {unconditional, conditional, unconditional + guidance_scale * (conditional - unconditional)};
}

std::vector<float> sample(const Denoiser& denoiser, const SchedulePlan& plan, SamplerState state,
                          at::IntArrayRef shape, const SamplerCallbacks& callbacks) {
  PATINA_CHECK_EQ(static_cast<int64_t>(state.latents.size()), c10::multiply_integers(shape));
  const int end = std::min(callbacks.end.value_or(plan.num_calls()), plan.num_calls());
  while (state.next_call < end) {
    const int index = state.next_call;
    if (callbacks.late) hold_latents(*callbacks.late, plan, index, state.latents);
    std::vector<float> input = scale_model_input(plan, index, state.latents);
    std::vector<std::vector<float>> references;
    std::vector<at::Tensor> noised;
    for (const DenoiserReference& reference : denoiser.references) {
      references.push_back(
          scale_model_input(plan, index, add_noise(plan, index, reference.x0, reference.noise)));
      noised.push_back(at::from_blob(references.back().data(), reference.shape, at::kFloat));
    }
    const Guided prediction = denoiser(at::from_blob(input.data(), shape, at::kFloat),
                                       plan.timesteps[static_cast<size_t>(index)], noised);
    const std::vector<float> noise =
        needs_noise(plan, index) ? callbacks.noise(index, state.latents.size()) : std::vector<float>{};
    std::vector<float> held;
    std::span<const float> output = values_of(prediction.guided);
    if (callbacks.late) {
      held.assign(output.begin(), output.end());
      hold_output(*callbacks.late, plan, index, held);
      output = held;
    }
    state.latents = step(plan, state.scheduler, index, output, state.latents, noise);
    ++state.next_call;
    if (callbacks.on_step) callbacks.on_step(state, prediction);
  }
  if (callbacks.late && end == plan.num_calls()) restore_start(*callbacks.late, plan, state.latents);
  return std::move(state.latents);
}

std::vector<uint8_t> to_bytes(const SamplerState& state) {
  const std::vector<uint8_t> scheduler = to_bytes(state.scheduler);
  const uint64_t header[3] = {
      kStateMagic | static_cast<uint64_t>(static_cast<uint32_t>(state.next_call)) << 32, state.latents.size(),
      scheduler.size()};
  const size_t latent_bytes = state.latents.size() * sizeof(float);
  std::vector<uint8_t> bytes(sizeof header + latent_bytes + scheduler.size());
  std::memcpy(bytes.data(), header, sizeof header);
  std::memcpy(bytes.data() + sizeof header, state.latents.data(), latent_bytes);
  std::memcpy(bytes.data() + sizeof header + latent_bytes, scheduler.data(), scheduler.size());
  return bytes;
}

SamplerState sampler_state_from_bytes(std::span<const uint8_t> bytes) {
  uint64_t header[3];
  const auto fail = [] {
    throw Error(ErrorCode::kFormat, "checkpoint", "is damaged or of another version; start the stage again");
  };
  if (bytes.size() < sizeof header) fail();
  std::memcpy(header, bytes.data(), sizeof header);
  const uint64_t rest = bytes.size() - sizeof header;
  if ((header[0] & 0xFFFFFFFFu) != kStateMagic || header[1] > rest / sizeof(float) ||
      header[2] != rest - header[1] * sizeof(float))
    fail();

  SamplerState state;
  state.next_call = static_cast<int>(header[0] >> 32);
  state.latents.resize(header[1]);
  const size_t latent_bytes = header[1] * sizeof(float);
  std::memcpy(state.latents.data(), bytes.data() + sizeof header, latent_bytes);
  state.scheduler = scheduler_state_from_bytes(bytes.subspan(sizeof header + latent_bytes));
  return state;
}

}  // namespace patina::diffusion
