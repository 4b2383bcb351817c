// What U-Net and ControlNets are given alike at every step. A family that conditions on more (sizes, pooled
// text) adds its field here; nobody's signature changes.
#pragma once

#include <span>
#include <vector>

#include <ATen/core/Tensor.h>

#include "patina/diffusion/networks/part_pixels.h"
#include "patina/diffusion/networks/reference.h"
#include "patina/nn/attend.h"

namespace patina::diffusion {

/// Prompts as the networks see them.
struct TextConditioning {
  at::Tensor tokens;  // [B,T,D]
  at::Tensor pooled;  // [B,D] at each prompt's first end token
};

/// Prompts one behind the other: along B. Undefined parts stay so.
TextConditioning stack_prompts(std::span<const TextConditioning> prompts);
/// What several text encoders make of the same prompts: tokens side by side along D, the last one's pooled.
TextConditioning join_encoders(std::span<const TextConditioning> encoders);
/// In groups of `size` prompts, the last maybe smaller.
std::vector<TextConditioning> split_prompts(const TextConditioning& text, int64_t size);

struct NetworkInputs {
  at::Tensor sample;                            // [B,C,H,W] scaled latents
  at::Tensor timesteps;                         // [1] or [B] f32
  TextConditioning text;                        // of B prompts
  const nn::SelfAttentionBias* bias = nullptr;  // acts on the self-attention; null: none
  // Parts of the picture that attend to words of their own: of B prompts, one a part. `part_levels` has one
  // part more, the first, which attends to `text`; null: all of the picture does.
  std::vector<TextConditioning> part_texts = {};
  const PartLevels* part_levels = nullptr;
  std::vector<Reference> references = {};  // pictures that the prompts' last sees beside the views
};

}  // namespace patina::diffusion
