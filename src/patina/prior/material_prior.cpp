#include "patina/prior/material_prior.h"

#include <algorithm>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/base/check.h"
#include "patina/image/color.h"
#include "patina/nn/file_weights.h"
#include "patina/prior/material_network.h"

namespace patina::prior {
namespace {

using at::Tensor;

// [H,W,C] → [1,C,H,W].
Tensor tensor_of(const Image& image, int channels, const MaterialView& view) {
  PATINA_CHECK_EQ(image.channels, channels);
  PATINA_CHECK_EQ(image.width, view.edited.width);
  PATINA_CHECK_EQ(image.height, view.edited.height);
  return at::from_blob(const_cast<float*>(image.pixels.data()), {1, image.height, image.width, channels},
                       at::kFloat)
      .permute({0, 3, 1, 2});
}

Image image_of(const Tensor& tensor) {
  const Tensor hwc = tensor[0].permute({1, 2, 0}).contiguous();
  Image out(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), static_cast<int>(hwc.size(2)));
  std::copy_n(hwc.data_ptr<float>(), out.pixels.size(), out.pixels.begin());
  return out;
}

Image with_srgb(const Image& image) {
  Image out = image;
  for (float& value : out.pixels) value = srgb_from_linear(std::clamp(value, 0.0f, 1.0f));
  return out;
}

// Repeats the last row and column until both sides are multiples of `multiple`.
Tensor padded(const Tensor& x, int64_t multiple) {
  const auto missing = [&](int64_t n) { return (multiple - n % multiple) % multiple; };
  return at::replication_pad2d(x.contiguous(), {0, missing(x.size(3)), 0, missing(x.size(2))});
}

}  // namespace

vec3 bent_normal(const vec3& normal, const vec2& slope) {
  const float k = 1 / std::max(1 + normal.z, 1e-3f), mixed = -normal.x * normal.y * k;
  const vec3 t(1 - normal.x * normal.x * k, mixed, -normal.x),
      b(mixed, 1 - normal.y * normal.y * k, -normal.y);
  return glm::normalize(slope.x * t + slope.y * b + normal);
}

struct MaterialPrior::Loaded {
  MaterialConfig config;
  MaterialNetwork network;
};

MaterialPrior::MaterialPrior(const std::filesystem::path& folder) {
  const MaterialConfig config = read_material_config(folder / kMaterialConfigFile);
  const nn::SafeTensors file(folder / kMaterialWeightFile);
  nn::FileWeights source(file);
  nn::WeightReader weights(source, at::kFloat);
  const MaterialNetwork network(config, weights);
  weights.finish();
  loaded_ = std::make_unique<const Loaded>(Loaded{config, network});
}
MaterialPrior::~MaterialPrior() = default;
MaterialPrior::MaterialPrior(MaterialPrior&&) noexcept = default;
MaterialPrior& MaterialPrior::operator=(MaterialPrior&&) noexcept = default;

MaterialEstimate MaterialPrior::operator()(const MaterialView& view) const {
  const c10::InferenceMode inference;
  PATINA_CHECK(!view.edited.empty());
  const int64_t height = view.edited.height, width = view.edited.width;
  const Image base_color = with_srgb(view.base_color);
  const auto input = [&](const Image& image, int channels) {
    return padded(tensor_of(image, channels, view), loaded_->config.multiple());
  };
  MaterialInputs inputs;
  inputs.mask = (input(view.coverage, 1) > 0.5).to(at::kFloat);
  // What lies outside the object may be anything, infinite too, and must not reach the network.
  const auto on_object = [&](const Tensor& x) {
    return at::where(inputs.mask > 0, x, at::zeros({}, x.options()));
  };
  inputs.edited = input(view.edited, 3);
  inputs.render = input(view.render, 3);
  inputs.normal = on_object(input(view.normal, 3));
  inputs.base_color = on_object(input(base_color, 3));
  inputs.roughness = on_object(input(view.roughness, 1));
  inputs.metallic = on_object(input(view.metallic, 1));

  const MaterialOutputs outputs = loaded_->network(inputs);
  const auto result = [&](const Tensor& x) {
    return image_of(on_object(x).slice(2, 0, height).slice(3, 0, width));
  };
  MaterialEstimate out;
  out.base_color = result(outputs.base_color.clamp(0, 1));
  for (float& value : out.base_color.pixels) value = linear_from_srgb(value);
  out.roughness = result(outputs.roughness.clamp(0, 1));
  out.metallic = result(outputs.metallic_logit.sigmoid());
  out.slope = result(outputs.slope);
  out.base_color_error = result(outputs.base_color_error);
  out.roughness_error = result(outputs.roughness_error);
  out.slope_error = result(outputs.slope_error);
  return out;
}

}  // namespace patina::prior
