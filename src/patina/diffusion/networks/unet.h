// The denoising U-Net of Stable Diffusion [Rombach2022], sized by its config.json, and the encoder half of it
// that ControlNets copy.
#pragma once

#include <filesystem>

#include "patina/diffusion/networks/blocks.h"
#include "patina/diffusion/networks/inputs.h"

namespace patina::diffusion {

/// Sinusoidal embedding of timesteps [B] f32 -> [B,width] f32 [Ho2020, after Vaswani2017].
at::Tensor timestep_embedding(const at::Tensor& timesteps, int64_t width, bool flip_sin_to_cos,
                              double freq_shift);

/// MLP on the sinusoidal embedding.
struct TimeEmbedding {
  nn::Linear linear_1, linear_2;
};

/// One resolution on the way down: every layer's output is kept for the way up.
struct DownBlock {
  std::string name;
  std::vector<ResnetBlock> resnets;
  std::vector<Transformer> attentions;       // empty, or one a resnet
  std::optional<Downsample> downsamplers_0;  // not at the coarsest level
};

struct MidBlock {
  std::string name;
  ResnetBlock resnets_0;
  Transformer attentions_0;
  ResnetBlock resnets_1;
};

struct UpBlock {
  std::string name;
  std::vector<ResnetBlock> resnets;  // each takes one kept output of the way down beside its input
  std::vector<Transformer> attentions;
  std::optional<Upsample> upsamplers_0;  // not at the finest level
};

/// From latents to the middle; the part of the U-Net that a ControlNet is a copy of.
struct Encoder {
  UNetConfig config;
  nn::Conv2d conv_in;
  TimeEmbedding time_embedding;
  std::vector<DownBlock> down_blocks;
  MidBlock mid_block;

  /// timesteps [B] f32 -> [B,E], through SiLU.
  at::Tensor time(const at::Tensor& timesteps, const nn::Recorder& record) const;
  /// What the blocks see of the inputs, on the weights' device and of their type.
  Conditions conditions(const NetworkInputs& inputs, const nn::Recorder& record) const;
  /// Everything after conv_in: x [B,C0,H,W] -> the kept outputs, finest first (x itself is the first), and
  /// the middle's.
  struct Outputs {
    std::vector<at::Tensor> skips;
    at::Tensor mid;
  };
  Outputs operator()(const at::Tensor& x, const Conditions& conditions) const;
};
Encoder load_encoder(nn::WeightReader& weights, const UNetConfig& config);

/// What ControlNets add to the U-Net's kept outputs and to its middle; empty: nothing.
struct ControlResiduals {
  std::vector<at::Tensor> down;
  at::Tensor mid;
};

class UNet {
 public:
  /// Takes its tensors from `weights`; what does not fit, weights.finish() tells.
  UNet(const UNetConfig& config, nn::WeightReader& weights);
  /// Reads <folder>/config.json and the weights beside it, as `type` (f32 or bf16). Throws Error.
  UNet(const std::filesystem::path& folder, at::ScalarType type);

  /// The predicted noise (or what the scheduler's prediction type says), [B,C,H,W], of the weights' type and
  /// on their device, to which inputs go. Takes what the ControlNets add by value, since it lets go of each
  /// residual that is used up: move it in where memory counts.
  at::Tensor operator()(const NetworkInputs& inputs, ControlResiduals control = {},
                        const nn::Recorder& record = {}) const;

  const UNetConfig& config() const { return encoder_.config; }
  int64_t num_parameters() const { return count_.parameters; }
  int64_t num_bytes() const { return count_.bytes; }
  at::ScalarType type() const { return type_; }

 private:
  at::ScalarType type_;
  nn::WeightCount count_;
  Encoder encoder_;
  std::vector<UpBlock> up_blocks_;
  nn::GroupNorm conv_norm_out_;
  nn::Conv2d conv_out_;
};

}  // namespace patina::diffusion
