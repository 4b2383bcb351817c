// The layers of which the networks are built: a struct of weights, made by load_*, applied by operator(). A
// layer's name is the path of its weights, under which it reports its output to the recorder.
#pragma once

#include <memory>
#include <string>

#include <ATen/core/Tensor.h>

#include "patina/nn/recorder.h"
#include "patina/nn/weights.h"
#include "patina/nn/winograd.h"

namespace patina::nn {

/// y = x Wᵀ + b over the last axis.
struct Linear {
  std::string name;
  at::Tensor weight;  // [out, in]
  at::Tensor bias;    // [out], undefined if there is none

  at::Tensor operator()(const at::Tensor& x, const Recorder& record) const;
};

/// Cross-correlation of [B,C,H,W], channels-last in and out.
struct Conv2d {
  std::string name;
  at::Tensor weight;  // [out, in, k, k] channels-last; undefined where `winograd` stands for it
  at::Tensor bias;    // [out]
  int64_t stride = 1, padding = 0;
  std::shared_ptr<const Winograd> winograd;  // null: LibTorch's convolution

  at::Tensor operator()(const at::Tensor& x, const Recorder& record) const;
};

/// Over groups of channels of [B,C,H,W], channels-last out; statistics in f32 whatever the dtype of x.
struct GroupNorm {
  std::string name;
  at::Tensor weight, bias;  // [C] f32
  int64_t num_groups = 32;
  double epsilon = 1e-5;

  at::Tensor operator()(const at::Tensor& x, const Recorder& record) const;
  /// silu((*this)(x)), in one pass where nothing records the value in between.
  at::Tensor with_silu(const at::Tensor& x, const Recorder& record) const;
};

/// Over the last axis; statistics in f32 whatever the dtype of x.
struct LayerNorm {
  std::string name;
  at::Tensor weight, bias;  // [C] f32
  double epsilon = 1e-5;

  at::Tensor operator()(const at::Tensor& x, const Recorder& record) const;
};

Linear load_linear(WeightReader& weights, const std::string& name, int64_t in, int64_t out, bool bias = true);
/// A linear layer whose weight may also be stored as a 1×1 convolution [out, in, 1, 1] if `as_convolution`
/// says so.
Linear load_linear_1x1(WeightReader& weights, const std::string& name, int64_t in, int64_t out,
                       bool as_convolution);
Conv2d load_conv2d(WeightReader& weights, const std::string& name, int64_t in, int64_t out, int64_t kernel,
                   int64_t stride = 1);
GroupNorm load_group_norm(WeightReader& weights, const std::string& name, int64_t channels,
                          int64_t num_groups, double epsilon);
LayerNorm load_layer_norm(WeightReader& weights, const std::string& name, int64_t channels,
                          double epsilon = 1e-5);

/// x · sigmoid(x).
at::Tensor silu(const at::Tensor& x);
/// [..., 2n] -> [..., n]: the first half times GELU of the second [Shazeer2020].
at::Tensor geglu(const at::Tensor& x);
/// x · sigmoid(1.702 x), CLIP's approximation of GELU.
at::Tensor quick_gelu(const at::Tensor& x);

/// [B,C,H,W] channels-last <-> tokens [B,H·W,C], without a copy.
at::Tensor tokens_from_image(const at::Tensor& x);
at::Tensor image_from_tokens(const at::Tensor& tokens, int64_t height, int64_t width);

}  // namespace patina::nn
