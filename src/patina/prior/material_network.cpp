#include "patina/prior/material_network.h"

#include <ATen/ATen.h>
#include <nlohmann/json.hpp>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/base/files.h"

namespace patina::prior {
namespace {

using at::Tensor;

constexpr int64_t kInputChannels = 18, kOutputChannels = 10;
constexpr int64_t kPack = 2;  // pixels a side that become channels
constexpr double kEpsilon = 1e-5;
constexpr size_t kMaxLevels = 6;
constexpr int64_t kMaxChannels = 4096;

// A clean map that says "metal" or "none" starts with this logit.
constexpr double kMetallicLogit = 3;
// Errors to expect before training, and their bounds: below the least an error is a rounding error of the
// maps.
constexpr double kStartError = 0.1, kLeastLogError = -6, kMostLogError = 1;
// Keeps the quotient of dark pixels within bounds: about one step of 8-bit sRGB near black, in linear light.
constexpr double kDarkness = 0.002;
constexpr double kMostReinhard = 0.985;  // of a tone-mapped value that is turned back into light

Tensor linear_from_srgb(const Tensor& srgb) {
  return at::where(srgb <= 0.04045, srgb / 12.92, ((srgb.clamp_min(0) + 0.055) / 1.055).pow(2.4));
}
Tensor srgb_from_linear(const Tensor& linear) {
  return at::where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear.clamp_min(1e-6).pow(1 / 2.4) - 0.055);
}

// Exposed radiance of a picture that was tone-mapped by x / (1 + x) and sRGB.
Tensor light_of(const Tensor& picture) {
  const Tensor mapped = linear_from_srgb(picture.clamp(0, 1)).clamp_max(kMostReinhard);
  return mapped / (1 - mapped);
}

// The camera's x and y axes turned the shortest way so that z lies on `n`: [B,3,H,W] each.
std::pair<Tensor, Tensor> tangents(const Tensor& n) {
  const Tensor x = n.slice(1, 0, 1), y = n.slice(1, 1, 2), z = n.slice(1, 2, 3);
  const Tensor k = 1 / (1 + z).clamp_min(1e-3);
  const Tensor mixed = -x * y * k;
  return {at::cat({1 - x * x * k, mixed, -x}, 1), at::cat({mixed, 1 - y * y * k, -y}, 1)};
}

MaterialBlock load_block(nn::WeightReader& weights, const std::string& name, int64_t channels,
                         const MaterialConfig& config) {
  return {nn::load_group_norm(weights, name + ".norm1", channels, config.norm_groups, kEpsilon),
          nn::load_conv2d(weights, name + ".conv1", channels, channels, 3),
          nn::load_group_norm(weights, name + ".norm2", channels, config.norm_groups, kEpsilon),
          nn::load_conv2d(weights, name + ".conv2", channels, channels, 3)};
}

}  // namespace

MaterialConfig read_material_config(const std::filesystem::path& file) {
  const auto json = nlohmann::json::parse(read_text_file(file), nullptr, /*allow_exceptions=*/false);
  const auto bad = [&](const std::string& what) { throw Error(ErrorCode::kFormat, file.string(), what); };
  const auto is_count = [](const nlohmann::json& value) {
    return value.is_number_integer() && value > 0 && value <= kMaxChannels;
  };
  if (!json.is_object()) bad("expected a JSON object with \"channels\" and \"norm_groups\"");
  MaterialConfig config;
  if (!json.contains("norm_groups") || !is_count(json["norm_groups"]))
    bad("\"norm_groups\": expected an integer from 1 to 4096");
  config.norm_groups = json["norm_groups"];
  if (!json.contains("channels") || !json["channels"].is_array() || json["channels"].empty() ||
      json["channels"].size() > kMaxLevels)
    bad("\"channels\": expected an array of one to six integers");
  config.channels.clear();
  for (const auto& value : json["channels"]) {
    if (!is_count(value) || value.get<int64_t>() % config.norm_groups != 0)
      bad("\"channels\": expected multiples of \"norm_groups\", at most 4096");
    config.channels.push_back(value);
  }
  return config;
}

Tensor divided_base_color(const MaterialInputs& inputs) {
  const Tensor change = (light_of(inputs.edited) + kDarkness) / (light_of(inputs.render) + kDarkness);
  return srgb_from_linear((linear_from_srgb(inputs.base_color) * change).clamp(0, 1));
}

Tensor bent_normals(const Tensor& normal, const Tensor& slope) {
  const auto [t, b] = tangents(normal);
  const Tensor bent = slope.slice(1, 0, 1) * t + slope.slice(1, 1, 2) * b + normal;
  return bent / bent.norm(2, {1}, true);
}

Tensor slopes_between(const Tensor& normal, const Tensor& bent) {
  const auto [t, b] = tangents(normal);
  const auto along = [&](const Tensor& axis) { return (axis * bent).sum({1}, true); };
  return (at::cat({along(t), along(b)}, 1) / along(normal).clamp_min(0.05)).clamp(-kMaxSlope, kMaxSlope);
}

Tensor MaterialBlock::operator()(const Tensor& x) const {
  const nn::Recorder none;
  return x + conv2(norm2.with_silu(conv1(norm1.with_silu(x, none), none), none), none);
}

MaterialNetwork::MaterialNetwork(const MaterialConfig& config, nn::WeightReader& weights) : config_(config) {
  const std::vector<int64_t>& channels = config.channels;
  conv_in_ = nn::load_conv2d(weights, "conv_in", kInputChannels * kPack * kPack, channels.front(), 3);
  for (size_t i = 0; i < channels.size(); ++i) {
    const std::string name = "levels." + std::to_string(i);
    Level level{load_block(weights, name + ".down", channels[i], config),
                load_block(weights, name + ".up", channels[i], config),
                {},
                {}};
    if (i + 1 < channels.size()) {
      level.downsample =
          nn::load_conv2d(weights, name + ".downsample", channels[i], channels[i + 1], 3, /*stride=*/2);
      level.upsample = nn::load_conv2d(weights, name + ".upsample", channels[i + 1], channels[i], 1);
    }
    levels_.push_back(std::move(level));
  }
  norm_out_ = nn::load_group_norm(weights, "norm_out", channels.front(), config.norm_groups, kEpsilon);
  conv_out_ = nn::load_conv2d(weights, "conv_out", channels.front(), kOutputChannels * kPack * kPack, 3);
}

MaterialOutputs MaterialNetwork::operator()(const MaterialInputs& inputs) const {
  const Tensor& mask = inputs.mask;
  PATINA_CHECK(inputs.edited.dim() == 4 && inputs.edited.size(2) % config_.multiple() == 0 &&
               inputs.edited.size(3) % config_.multiple() == 0);
  const nn::Recorder none;
  const Tensor divided = divided_base_color(inputs);
  const Tensor x = at::cat(
      {inputs.edited - 0.5, inputs.render - 0.5, inputs.normal * mask, (inputs.base_color - 0.5) * mask,
       (divided - 0.5) * mask, (inputs.roughness - 0.5) * mask, (inputs.metallic - 0.5) * mask, mask},
      1);
  PATINA_CHECK_EQ(x.size(1), kInputChannels);

  Tensor h = conv_in_(at::pixel_unshuffle(x, kPack).contiguous(at::MemoryFormat::ChannelsLast), none);
  std::vector<Tensor> skips;
  for (const Level& level : levels_) {
    h = level.down(h);
    skips.push_back(h);
    if (level.downsample) h = (*level.downsample)(h, none);
  }
  for (size_t i = levels_.size(); i-- > 0;) {
    if (levels_[i].upsample)
      h = at::upsample_nearest2d((*levels_[i].upsample)(h, none), {skips[i].size(2), skips[i].size(3)}) +
          skips[i];
    h = levels_[i].up(h);
  }
  const Tensor y = at::pixel_shuffle(conv_out_(norm_out_.with_silu(h, none), none), kPack);

  const auto error = [&](int64_t channel) {
    return (y.slice(1, channel, channel + 1) + std::log(kStartError))
        .clamp(kLeastLogError, kMostLogError)
        .exp();
  };
  MaterialOutputs out;
  out.base_color = divided + y.slice(1, 0, 3);
  out.roughness = inputs.roughness + y.slice(1, 3, 4);
  out.metallic_logit = kMetallicLogit * (2 * inputs.metallic - 1) + y.slice(1, 4, 5);
  out.slope = y.slice(1, 5, 7);
  out.base_color_error = error(7);
  out.roughness_error = error(8);
  out.slope_error = error(9);
  return out;
}

}  // namespace patina::prior
