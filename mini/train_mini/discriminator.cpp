#include "discriminator.h"

#include <array>
#include <string>

#include <ATen/ATen.h>
#include <torch/csrc/autograd/autograd.h>

namespace patina::train_mini {
namespace {

constexpr double kSlope = 0.2;  // of the leaky rectifiers

struct Layer {
  int64_t channels, kernel, stride;
};
constexpr std::array<Layer, 4> kLayers{{{32, 4, 2}, {64, 4, 2}, {128, 4, 2}, {128, 3, 1}}};

}  // namespace

Discriminator::Discriminator(nn::WeightReader& weights) {
  int64_t channels = 3;
  for (size_t i = 0; i < kLayers.size(); ++i) {
    hidden_.push_back(nn::load_conv2d(weights, "hidden." + std::to_string(i), channels, kLayers[i].channels,
                                      kLayers[i].kernel, kLayers[i].stride));
    if (kLayers[i].kernel == 4) hidden_.back().padding = 1;
    channels = kLayers[i].channels;
  }
  last_ = nn::load_conv2d(weights, "last", channels, 1, 3);
}

Discriminator::Judgement Discriminator::operator()(const at::Tensor& grain) const {
  Judgement judgement;
  at::Tensor h = grain.contiguous(at::MemoryFormat::ChannelsLast);
  for (const nn::Conv2d& layer : hidden_) {
    h = at::leaky_relu(layer(h, {}), kSlope);
    judgement.features.push_back(h);
  }
  judgement.scores = last_(h, {});
  return judgement;
}

at::Tensor grain_of(const at::Tensor& pictures) {
  constexpr int64_t kWindow = 9;
  return 4 * (pictures - at::avg_pool2d(pictures, kWindow, 1, kWindow / 2, /*ceil_mode=*/false,
                                        /*count_include_pad=*/false));
}

at::Tensor slope_penalty(const Discriminator& discriminator, const at::Tensor& grain) {
  const at::Tensor x = grain.detach().set_requires_grad(true);
  const at::Tensor scores = discriminator(x).scores;
  const at::Tensor slope = torch::autograd::grad({scores.sum()}, {x}, {}, /*retain_graph=*/true,
                                                 /*create_graph=*/true)[0];
  return slope.square().sum() / static_cast<double>(scores.numel());
}

}  // namespace patina::train_mini
