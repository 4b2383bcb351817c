#include "patina/nn/layers.h"

#include <ATen/ATen.h>
#include <c10/core/GradMode.h>
#include <torch/version.h>

#include "patina/base/check.h"
#include "patina/nn/pointwise.h"

namespace patina::nn {

at::Tensor Linear::operator()(const at::Tensor& x, const Recorder& record) const {
  return record(name, at::linear(x, weight, bias.defined() ? c10::optional<at::Tensor>(bias) : c10::nullopt));
}

at::Tensor Conv2d::operator()(const at::Tensor& x, const Recorder& record) const {
  if (!winograd) return record(name, at::conv2d(x, weight, bias, stride, padding));
  PATINA_CHECK(x.dim() == 4 && x.size(1) == winograd->in() && x.scalar_type() == at::kBFloat16 && x.is_cpu());
  const at::Tensor image = x.contiguous(at::MemoryFormat::ChannelsLast);
  const at::Tensor y = at::empty({x.size(0), winograd->out(), x.size(2), x.size(3)},
                                 x.options().memory_format(at::MemoryFormat::ChannelsLast));
  (*winograd)(static_cast<const Bf16*>(image.data_ptr()), static_cast<Bf16*>(y.data_ptr()), x.size(0),
              x.size(2), x.size(3));
  return record(name, y);
}

namespace {

/// Whether our own kernels can take x: they record no gradients.
bool suits_kernels(const at::Tensor& x) {
  return !c10::GradMode::is_enabled() && x.is_cpu() &&
         (x.scalar_type() == at::kFloat || x.scalar_type() == at::kBFloat16);
}

/// Whether a convolution with this weight can be Winograd's, which records no gradients either.
bool suits_winograd(const at::Tensor& weight) {
  return weight.is_cpu() && weight.scalar_type() == at::kBFloat16 && !weight.requires_grad() &&
         winograd_pays();
}

/// f(T*, T*) with the numbers of `x` and `y` as their type.
template <class F>
void with_numbers(const at::Tensor& x, const at::Tensor& y, const F& f) {
  if (x.scalar_type() == at::kFloat) {
    f(x.data_ptr<float>(), y.data_ptr<float>());
  } else {
    f(static_cast<const Bf16*>(x.data_ptr()), static_cast<Bf16*>(y.data_ptr()));
  }
}

NormWeights norm_weights(const at::Tensor& gain, const at::Tensor& bias, double epsilon) {
  return {gain.data_ptr<float>(), bias.data_ptr<float>(), static_cast<float>(epsilon)};
}

/// Whether LibTorch's group_norm takes bf16 pixels with f32 gains, and takes them faster than after a
/// conversion: on processors, LibTorch 2.x, large images (8 × 16 × 128²: 12.5 against 26 ms forward and back;
/// 8 × 64 × 16²: 1.2 against 0.4 ms).
bool takes_mixed_types(const at::Tensor& x) {
#if TORCH_VERSION_MAJOR >= 2
  constexpr int64_t kLargePixels = 1024;
  return x.is_cpu() && x.scalar_type() == at::kBFloat16 && x.size(2) * x.size(3) >= kLargePixels;
#else
  (void)x;
  return false;
#endif
}

at::Tensor normed(const GroupNorm& norm, const at::Tensor& x, Activation activation) {
  const at::Tensor image = x.contiguous(at::MemoryFormat::ChannelsLast);
  const at::Tensor y = at::empty_like(image);
  with_numbers(image, y, [&](const auto* from, auto* to) {
    group_norm(from, to, x.size(0), x.size(2) * x.size(3), x.size(1), norm.num_groups,
               norm_weights(norm.weight, norm.bias, norm.epsilon), activation);
  });
  return y;
}

}  // namespace

at::Tensor GroupNorm::operator()(const at::Tensor& x, const Recorder& record) const {
  if (suits_kernels(x)) return record(name, normed(*this, x, Activation::kNone));
  const bool as_is = takes_mixed_types(x);
  const at::Tensor y = at::group_norm(as_is ? x : x.to(at::kFloat), num_groups, weight, bias, epsilon);
  return record(name, as_is ? y : y.to(x.scalar_type()));
}

at::Tensor GroupNorm::with_silu(const at::Tensor& x, const Recorder& record) const {
  if (record.listens() || !suits_kernels(x)) return nn::silu((*this)(x, record));
  return normed(*this, x, Activation::kSilu);
}

at::Tensor LayerNorm::operator()(const at::Tensor& x, const Recorder& record) const {
  if (suits_kernels(x)) {
    const at::Tensor rows = x.contiguous(), y = at::empty_like(rows);
    const int64_t channels = weight.size(0);
    with_numbers(rows, y, [&](const auto* from, auto* to) {
      layer_norm(from, to, rows.numel() / channels, channels, norm_weights(weight, bias, epsilon));
    });
    return record(name, y);
  }
  return record(name,
                at::layer_norm(x.to(at::kFloat), weight.sizes(), weight, bias, epsilon).to(x.scalar_type()));
}

at::Tensor geglu(const at::Tensor& x) {
  if (!suits_kernels(x)) {
    const std::vector<at::Tensor> halves = x.chunk(2, -1);
    return halves[0] * at::gelu(halves[1]);
  }
  const at::Tensor rows = x.contiguous();
  std::vector<int64_t> shape = x.sizes().vec();
  shape.back() /= 2;
  const at::Tensor y = at::empty(shape, x.options());
  with_numbers(rows, y, [&](const auto* from, auto* to) {
    geglu(from, to, rows.numel() / (2 * shape.back()), shape.back());
  });
  return y;
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
  Conv2d layer{name,
               weights.take(name + ".weight", {out, in, kernel, kernel}),
               weights.take(name + ".bias", {out}),
               stride,
               kernel / 2,
               nullptr};
  const bool fits = kernel == 3 && stride == 1 && Winograd::takes(in, out);
  if (fits && suits_winograd(layer.weight) && !weights.low_memory()) {
    const at::Tensor weight = layer.weight.contiguous();
    layer.winograd =
        std::make_shared<const Winograd>(static_cast<const Bf16*>(weight.data_ptr()),
                                         static_cast<const Bf16*>(layer.bias.data_ptr()), in, out);
    weights.add_bytes(layer.winograd->num_bytes() - static_cast<int64_t>(weight.nbytes()));
    layer.weight.reset(), layer.bias.reset();
  } else {
    // Channels-last once here: oneDNN would else reorder the weight at every call.
    layer.weight = layer.weight.contiguous(at::MemoryFormat::ChannelsLast);
  }
  return layer;
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
