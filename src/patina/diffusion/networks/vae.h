// The autoencoder between images and latents [Kingma2014, Rombach2022]: encoder to the posterior, decoder
// back.
#pragma once

#include <filesystem>

#include "patina/diffusion/networks/blocks.h"

namespace patina::diffusion {

/// Single-headed self-attention over the pixels of [B,C,H,W], with a shortcut.
struct VaeAttention {
  std::string name;
  nn::GroupNorm group_norm;
  nn::Linear to_q, to_k, to_v, to_out_0;

  at::Tensor operator()(const at::Tensor& x, const nn::Recorder& record) const;
};

struct VaeMidBlock {
  std::string name;
  ResnetBlock resnets_0;
  std::optional<VaeAttention> attentions_0;
  ResnetBlock resnets_1;

  at::Tensor operator()(const at::Tensor& x, const nn::Recorder& record) const;
};

/// One resolution of either half; only one of the two resamplings is there, and none at the last level.
struct VaeBlock {
  std::string name;
  std::vector<ResnetBlock> resnets;
  std::optional<Downsample> downsamplers_0;
  std::optional<Upsample> upsamplers_0;

  at::Tensor operator()(const at::Tensor& x, const nn::Recorder& record) const;
};

struct VaeEncoder {
  nn::Conv2d conv_in;
  std::vector<VaeBlock> down_blocks;
  VaeMidBlock mid_block;
  nn::GroupNorm conv_norm_out;
  nn::Conv2d conv_out;
};

struct VaeDecoder {
  nn::Conv2d conv_in;
  VaeMidBlock mid_block;
  std::vector<VaeBlock> up_blocks;
  nn::GroupNorm conv_norm_out;
  nn::Conv2d conv_out;
};

/// Gaussian posterior of the latents, unscaled; [B,C,H/s,W/s] each.
struct Posterior {
  at::Tensor mean, logvar;  // logvar clamped to [-30, 20]
};

class Vae {
 public:
  /// Takes its tensors from `weights`; what does not fit, weights.finish() tells.
  Vae(const VaeConfig& config, nn::WeightReader& weights);
  /// Reads <folder>/config.json and the weights beside it, with today's or the older attention names. Throws
  /// Error.
  Vae(const std::filesystem::path& folder, at::ScalarType type);

  /// Inputs go to the device of the weights, where outputs stay. image [B,3,H,W] in [-1,1], H and W divisible
  /// by the latent scale.
  Posterior encode(const at::Tensor& image, const nn::Recorder& record = {}) const;
  /// latents [B,C,h,w], unscaled -> image [B,3,s·h,s·w], about [-1,1].
  at::Tensor decode(const at::Tensor& latents, const nn::Recorder& record = {}) const;

  const VaeConfig& config() const { return config_; }
  int64_t num_parameters() const { return count_.parameters; }
  int64_t num_bytes() const { return count_.bytes; }

 private:
  at::ScalarType type_;
  nn::WeightCount count_;
  VaeConfig config_;
  VaeEncoder encoder_;
  std::optional<nn::Conv2d> quant_conv_, post_quant_conv_;
  VaeDecoder decoder_;
};

}  // namespace patina::diffusion
