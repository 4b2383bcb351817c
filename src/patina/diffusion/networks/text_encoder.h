// CLIP's text transformer [Radford2021]: token ids to the sequence of vectors that the U-Net attends to.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/diffusion/files/config.h"
#include "patina/diffusion/networks/inputs.h"
#include "patina/nn/layers.h"

namespace patina::diffusion {

struct TextAttention {
  std::string name;
  nn::Linear q_proj, k_proj, v_proj, out_proj;
  int64_t num_heads = 1;

  /// Causal: a token sees itself and those before it.
  at::Tensor operator()(const at::Tensor& x, const nn::Recorder& record) const;
};

struct TextMlp {
  std::string name;
  nn::Linear fc1, fc2;
  TextActivation activation;

  at::Tensor operator()(const at::Tensor& x, const nn::Recorder& record) const;
};

struct TextLayer {
  std::string name;
  nn::LayerNorm layer_norm1;
  TextAttention self_attn;
  nn::LayerNorm layer_norm2;
  TextMlp mlp;

  at::Tensor operator()(const at::Tensor& x, const nn::Recorder& record) const;
};

class TextEncoder {
 public:
  /// Takes its tensors from `weights`; what does not fit, weights.finish() tells.
  TextEncoder(const TextEncoderConfig& config, nn::WeightReader& weights);
  /// Reads <folder>/config.json and the weights beside it, as `type`. Throws Error.
  TextEncoder(const std::filesystem::path& folder, at::ScalarType type);

  /// ids [B,T] int64, T <= max_positions -> tokens [B,T,D] after the final norm, and [B,D] of them at the
  /// first end token. `clip_skip` 1 runs all layers; n leaves out the last n - 1 before
  /// the final norm. `learned` [n,D], may be undefined, holds the vectors of the ids beyond the vocabulary.
  TextConditioning operator()(const at::Tensor& ids, int64_t clip_skip = 1, const nn::Recorder& record = {},
                              const at::Tensor& learned = {}) const;

  const TextEncoderConfig& config() const { return config_; }
  int64_t num_parameters() const { return count_.parameters; }
  int64_t num_bytes() const { return count_.bytes; }

 private:
  TextEncoderConfig config_;
  nn::WeightCount count_;
  at::Tensor token_embedding_;     // [V,D]
  at::Tensor position_embedding_;  // [P,D]
  std::vector<TextLayer> layers_;
  nn::LayerNorm final_layer_norm_;
};

}  // namespace patina::diffusion
