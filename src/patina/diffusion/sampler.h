// From noise to latents: the loop over a scheduler's steps, and the guided network that it calls.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "patina/base/progress.h"
#include "patina/diffusion/late_join.h"
#include "patina/diffusion/networks/controlnet.h"
#include "patina/diffusion/networks/held.h"
#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/schedulers/schedulers.h"

namespace patina::diffusion {

/// A ControlNet with its condition image already embedded.
struct Control {
  const Held<ControlNet>* network = nullptr;
  at::Tensor hint;  // [1,C,H,W]
  float scale = 1;
};

/// A picture that the views' self-attention sees too.
struct DenoiserReference {
  std::vector<float> x0, noise;  // [C,h,w] its latents, and the noise that they are under
  std::vector<int64_t> shape;    // [1,C,h,w]
  TextConditioning text;         // of one prompt
  ReferenceWeights weights;      // of the views' latent pixels
};

/// What the network says about one latent.
struct Guided {
  at::Tensor unconditional, conditional;  // [1,C,H,W] f32; without guidance both are `guided`
  at::Tensor guided;
};

/// The network with everything fixed but latent and time, with classifier-free guidance [Ho2022].
struct Denoiser {
  const UNet* unet = nullptr;
  std::vector<Control> controls;
  TextConditioning text;  // of two prompts, the negative one first; of one without guidance
  float guidance_scale = 1;
  bool one_batch = true;  // both prompts of guidance in one evaluation; else in turn, the negative one first
  const nn::SelfAttentionBias* bias = nullptr;  // null: none
  bool bias_controls = false;                   // whether it acts on the ControlNets too
  nn::Recorder record = {};                     // listens to the U-Net
  std::vector<TextConditioning> part_texts =
      {};  // of the parts that have words of their own; prompts as in `text`
  std::optional<PartLevels> part_levels = std::nullopt;  // where these act; nullopt: there are none
  std::vector<DenoiserReference> references = {};        // pictures that the edit shall be like

  /// latents [1,C,H,W] f32, scaled as the scheduler asks; `noised`: those of the references, likewise.
  Guided operator()(const at::Tensor& latents, double timestep,
                    std::span<const at::Tensor> noised = {}) const;
};

/// Where a run stands between two steps.
struct SamplerState {
  int next_call = 0;
  std::vector<float> latents;  // [C,H,W], unscaled
  SchedulerState scheduler;

  bool operator==(const SamplerState&) const = default;
};
/// Bytes that restore the state exactly. from_bytes throws Error{kFormat} if they are not what to_bytes made.
std::vector<uint8_t> to_bytes(const SamplerState& state);
SamplerState sampler_state_from_bytes(std::span<const uint8_t> bytes);

struct SamplerCallbacks {
  /// Unit-variance noise [C,H,W] for call `index`; asked for only where the scheduler draws noise.
  std::function<std::vector<float>(int index, size_t size)> noise;
  /// After every call; may be empty.
  std::function<void(const SamplerState& state, const Guided& prediction)> on_step;
  /// Only calls before this index are run; nullopt: all.
  std::optional<int> end = std::nullopt;
  /// Pixels that join late; null: all are denoised from the first call on.
  const LateJoin* late = nullptr;
};

/// Runs the plan's calls from `state` on and returns the last latents [C,H,W]. `shape` is [1,C,H,W].
std::vector<float> sample(const Denoiser& denoiser, const SchedulePlan& plan, SamplerState state,
                          at::IntArrayRef shape, const SamplerCallbacks& callbacks);

}  // namespace patina::diffusion
