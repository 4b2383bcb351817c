// The building blocks that U-Net, ControlNet and VAE share: residual blocks, transformers, resampling. Member
// names are the names of diffusers' modules, so a path in a weight file reads as a path in these structs.
//
// Axes: B batch, C channels, H W latent rows and columns, N = H·W image tokens, T text tokens, D text width,
// E time width.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "patina/diffusion/files/config.h"
#include "patina/diffusion/networks/part_pixels.h"
#include "patina/diffusion/networks/reference.h"
#include "patina/nn/attend.h"
#include "patina/nn/layers.h"

namespace patina::diffusion {

/// What every block of one evaluation of a network sees beside its input.
struct Conditions {
  at::Tensor time;                              // [B,E], through SiLU already
  std::vector<at::Tensor> texts;                // [B,T,D] of the prompt, and of each part of the picture
  const PartLevels* parts = nullptr;            // which pixels attend to which text; null: all to the first
  const nn::SelfAttentionBias* bias = nullptr;  // null: none
  std::span<const Reference> references;        // what the last of the batch sees beside the views
  const nn::Recorder& record;
};

/// x [B,in,H,W] -> [B,out,H,W]: two convolutions beside a shortcut, shifted by the time embedding between
/// them.
struct ResnetBlock {
  std::string name;
  nn::GroupNorm norm1;
  nn::Conv2d conv1;
  std::optional<nn::Linear> time_emb_proj;  // none in the VAE
  nn::GroupNorm norm2;
  nn::Conv2d conv2;
  std::optional<nn::Conv2d> conv_shortcut;  // where in and out differ

  at::Tensor operator()(const at::Tensor& x, const at::Tensor& time, const nn::Recorder& record) const;
};
/// `time_width` 0: without a time embedding.
ResnetBlock load_resnet(nn::WeightReader& weights, const std::string& name, int64_t in, int64_t out,
                        int64_t time_width, int64_t num_groups, double epsilon);

/// Queries from x [B,N,C], keys and values from `context` [B,M,·] -> [B,N,C].
struct Attention {
  std::string name;
  nn::Linear to_q, to_k, to_v, to_out_0;
  int64_t num_heads = 1;

  at::Tensor operator()(const at::Tensor& x, const at::Tensor& context, const nn::Recorder& record,
                        const nn::LevelBias& bias = {}, std::span<const nn::ExtraKeys> extra = {}) const;
  /// Every pixel of x attends to the text of the part that it shows, pixels of several parts to several.
  at::Tensor in_parts(const at::Tensor& x, std::span<const at::Tensor> texts,
                      std::span<const PartPixels> parts, const nn::Recorder& record) const;
};

/// Gated feed-forward: net.2(a · gelu(b)) with (a, b) = net.0.proj(x).
struct FeedForward {
  std::string name;
  nn::Linear net_0_proj, net_2;

  at::Tensor operator()(const at::Tensor& x, const nn::Recorder& record) const;
};

struct TransformerBlock {
  std::string name;
  nn::LayerNorm norm1;
  Attention attn1;  // of the image to itself: the one that the bias acts on
  nn::LayerNorm norm2;
  Attention attn2;  // of the image to the text
  nn::LayerNorm norm3;
  FeedForward ff;

  /// x [B,N,C], N = height · width.
  at::Tensor operator()(const at::Tensor& x, int64_t height, int64_t width,
                        const Conditions& conditions) const;
};

/// x [B,C,H,W] -> the same shape.
struct Transformer {
  std::string name;
  nn::GroupNorm norm;
  nn::Linear proj_in;
  std::vector<TransformerBlock> transformer_blocks;
  nn::Linear proj_out;

  at::Tensor operator()(const at::Tensor& x, const Conditions& conditions) const;
};
Transformer load_transformer(nn::WeightReader& weights, const std::string& name, const LevelConfig& level,
                             const UNetConfig& config);

/// [B,C,H,W] -> [B,C,⌈H/2⌉,⌈W/2⌉] by a strided convolution.
struct Downsample {
  std::string name;
  nn::Conv2d conv;

  at::Tensor operator()(const at::Tensor& x, const nn::Recorder& record) const;
};

/// [B,C,H,W] -> [B,C,height,width]: nearest neighbour, then a convolution.
struct Upsample {
  std::string name;
  nn::Conv2d conv;

  at::Tensor operator()(const at::Tensor& x, int64_t height, int64_t width, const nn::Recorder& record) const;
};

}  // namespace patina::diffusion
