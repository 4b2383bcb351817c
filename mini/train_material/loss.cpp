#include "loss.h"

#include <ATen/ATen.h>

namespace patina::train_material {
namespace {

using at::Tensor;

Tensor weighted_mean(const Tensor& values, const Tensor& weight) {
  return (values * weight).sum() / weight.sum().clamp_min(1);
}

// −log p of a Laplace distribution: mean |error| over the channels, divided by the scale, plus its logarithm.
Tensor likelihood(const Tensor& error, const Tensor& scale, const Tensor& weight) {
  return weighted_mean((error / scale + scale.log()) * scale.detach().sqrt(), weight);
}

}  // namespace

Loss loss_of(const prior::MaterialOutputs& outputs, const Truth& truth) {
  const auto error = [](const Tensor& a, const Tensor& b) { return (a - b).abs().mean({1}, true); };
  const Tensor& weight = truth.weight;
  const Tensor base = error(outputs.base_color, truth.base_color),
               roughness = error(outputs.roughness, truth.roughness),
               slope = error(outputs.slope, truth.slope);
  const Tensor cross_entropy = at::binary_cross_entropy_with_logits(outputs.metallic_logit, truth.metallic,
                                                                    {}, {}, at::Reduction::None);
  constexpr double kMetallicWeight = 0.5;
  Loss out;
  out.total = likelihood(base, outputs.base_color_error, weight) +
              likelihood(roughness, outputs.roughness_error, weight) +
              likelihood(slope, outputs.slope_error, weight) +
              kMetallicWeight * weighted_mean(cross_entropy, weight);
  const auto mean = [&](const Tensor& values) {
    return weighted_mean(values.detach(), weight).item<double>();
  };
  out.parts = {{"base", mean(base)},
               {"roughness", mean(roughness)},
               {"slope", mean(slope)},
               {"metallic", mean(cross_entropy)}};
  return out;
}

}  // namespace patina::train_material
