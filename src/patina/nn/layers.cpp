#include "patina/nn/layers.h"

#include <ATen/ATen.h>
#include <torch/version.h>

namespace patina::nn {

at::Tensor Linear::operator()(const at::Tensor& x, const Recorder& record) const {
  return record(name, at::linear(x, weight, bias.defined() ? c10::optional<at::Tensor>(bias) : c10::nullopt));
}

at::Tensor Conv2d::operator()(const at::Tensor& x, const Recorder& record) const {
  return record(name, at::conv2d(x, weight, bias, stride, padding));
}

namespace {

/// Whether group_norm takes bf16 pixels with f32 gains, and takes them faster than after a conversion: on
/// processors, LibTorch 2.x, large images (8 × 16 × 128²: 12.5 against 26 ms forward and back; 8 × 64 × 16²:
/// 1.2 against 0.4 ms).
bool takes_mixed_types(const at::Tensor& x) {
#if TORCH_VERSION_MAJOR >= 2
  constexpr int64_t kLargePixels = 1024;
  return x.is_cpu() && x.scalar_type() == at::kBFloat16 && x.size(2) * x.size(3) >= kLargePixels;
#else
  (void)x;
  return false;
#endif
}

}  // namespace

at::Tensor GroupNorm::operator()(const at::Tensor& x, const Recorder& record) const {
  const bool as_is = takes_mixed_types(x);
  const at::Tensor y = at::group_norm(as_is ? x : x.to(at::kFloat), num_groups, weight, bias, epsilon);
  return record(name, as_is ? y : y.to(x.scalar_type()));
}

at::Tensor LayerNorm::operator()(const at::Tensor& x, const Recorder& record) const {
  return record(name,
                at::layer_norm(x.to(at::kFloat), weight.sizes(), weight, bias, epsilon).to(x.scalar_type()));
}

Linear load_linear(WeightReader& weights, const std::string& name, int64_t in, int64_t out, bool bias) {
  Linear layer{name, weights.take(name + ".weight", {out, in}), {}};
  if (bias) layer.bias = weights.take(name + ".bias", {out});
  return layer;
}

Linear load_linear_1x1(WeightReader& weights, const std::string& name, int64_t in, int64_t out,
                       bool as_convolution) {
  if (!as_convolution) return load_linear(weights, name, in, out);
  return {name, weights.take(name + ".weight", {out, in, 1, 1}).view({out, in}),
          weights.take(name + ".bias", {out})};
}

Conv2d load_conv2d(WeightReader& weights, const std::string& name, int64_t in, int64_t out, int64_t kernel,
                   int64_t stride) {
  // Channels-last once here: oneDNN would else reorder the weight at every call.
  return {
      name,
      weights.take(name + ".weight", {out, in, kernel, kernel}).contiguous(at::MemoryFormat::ChannelsLast),
      weights.take(name + ".bias", {out}), stride, kernel / 2};
}

GroupNorm load_group_norm(WeightReader& weights, const std::string& name, int64_t channels,
                          int64_t num_groups, double epsilon) {
  return {name, weights.take(name + ".weight", {channels}, at::kFloat),
          weights.take(name + ".bias", {channels}, at::kFloat), num_groups, epsilon};
}

LayerNorm load_layer_norm(WeightReader& weights, const std::string& name, int64_t channels, double epsilon) {
  return {name, weights.take(name + ".weight", {channels}, at::kFloat),
          weights.take(name + ".bias", {channels}, at::kFloat), epsilon};
}

at::Tensor silu(const at::Tensor& x) {
  return at::silu(x);
}

at::Tensor quick_gelu(const at::Tensor& x) {
  return x * at::sigmoid(1.702 * x);
}

at::Tensor tokens_from_image(const at::Tensor& x) {
  return x.permute({0, 2, 3, 1}).reshape({x.size(0), x.size(2) * x.size(3), x.size(1)});
}

at::Tensor image_from_tokens(const at::Tensor& tokens, int64_t height, int64_t width) {
  return tokens.view({tokens.size(0), height, width, tokens.size(2)}).permute({0, 3, 1, 2});
}

}  // namespace patina::nn
