// ControlNet [Zhang2023]: a copy of the U-Net's encoder that sees a condition image and adds to what the
// U-Net keeps.
#pragma once

#include "patina/diffusion/networks/unet.h"

namespace patina::diffusion {

/// Convolutions that bring the condition image to latent resolution.
struct ConditionEmbedding {
  std::string name;
  nn::Conv2d conv_in;
  std::vector<nn::Conv2d> blocks;
  nn::Conv2d conv_out;

  at::Tensor operator()(const at::Tensor& condition, const nn::Recorder& record) const;
};

class ControlNet {
 public:
  /// Takes its tensors from `weights`; what does not fit, weights.finish() tells.
  ControlNet(const ControlNetConfig& config, nn::WeightReader& weights);
  /// Reads <folder>/config.json and the weights beside it, as `type`. Throws Error.
  ControlNet(const std::filesystem::path& folder, at::ScalarType type);

  /// condition [B,3,8H,8W] RGB in [0,1] -> hint [B,C,H,W]. Does not depend on the timestep: once a run.
  at::Tensor hint(const at::Tensor& condition, const nn::Recorder& record = {}) const;

  /// What to add to the U-Net of these inputs: residuals times `scale`. `hint` [1] or [B] as hint() makes it.
  ControlResiduals operator()(const NetworkInputs& inputs, const at::Tensor& hint, float scale,
                              const nn::Recorder& record = {}) const;

  const ControlNetConfig& config() const { return config_; }
  int64_t num_parameters() const { return count_.parameters; }
  int64_t num_bytes() const { return count_.bytes; }

 private:
  at::ScalarType type_;
  nn::WeightCount count_;
  ControlNetConfig config_;
  Encoder encoder_;
  ConditionEmbedding condition_embedding_;
  std::vector<nn::Conv2d> controlnet_down_blocks_;
  nn::Conv2d controlnet_mid_block_;
};

/// a + b; either may be empty.
ControlResiduals sum(ControlResiduals a, const ControlResiduals& b);

}  // namespace patina::diffusion
