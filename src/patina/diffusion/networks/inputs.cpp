#include "patina/diffusion/networks/inputs.h"

#include <ATen/ATen.h>

#include "patina/base/check.h"

namespace patina::diffusion {

TextConditioning stack_prompts(std::span<const TextConditioning> prompts) {
  PATINA_CHECK(!prompts.empty());
  std::vector<at::Tensor> tokens, pooled;
  for (const TextConditioning& prompt : prompts) {
    tokens.push_back(prompt.tokens);
    pooled.push_back(prompt.pooled);
  }
  return {at::cat(tokens), at::cat(pooled)};
}

TextConditioning join_encoders(std::span<const TextConditioning> encoders) {
  PATINA_CHECK(!encoders.empty());
  if (encoders.size() == 1) return encoders.front();
  std::vector<at::Tensor> tokens;
  for (const TextConditioning& encoder : encoders) tokens.push_back(encoder.tokens);
  return {at::cat(tokens, 2), encoders.back().pooled};
}

std::vector<TextConditioning> split_prompts(const TextConditioning& text, int64_t size) {
  std::vector<TextConditioning> groups;
  for (int64_t first = 0; first < text.tokens.size(0); first += size)
    groups.push_back({text.tokens.slice(0, first, first + size),
                      text.pooled.defined() ? text.pooled.slice(0, first, first + size) : at::Tensor()});
  return groups;
}

}  // namespace patina::diffusion
