#include "patina/diffusion/networks/controlnet.h"

#include <ATen/ATen.h>

#include "patina/base/check.h"
#include "patina/diffusion/files/unet_blocks.h"
#include "patina/diffusion/networks/component.h"

namespace patina::diffusion {
namespace {

ConditionEmbedding load_condition_embedding(nn::WeightReader& weights, const ControlNetConfig& config) {
  const std::string name = "controlnet_cond_embedding";
  const std::vector<int64_t>& channels = config.embedding_channels;
  ConditionEmbedding embedding;
  embedding.name = name;
  embedding.conv_in =
      nn::load_conv2d(weights, name + ".conv_in", config.conditioning_channels, channels.front(), 3);
  for (size_t i = 0; i + 1 < channels.size(); ++i) {
    // A convolution at this resolution, and one to half of it.
    const std::string same = name + ".blocks." + std::to_string(2 * i),
                      half = name + ".blocks." + std::to_string(2 * i + 1);
    embedding.blocks.push_back(nn::load_conv2d(weights, same, channels[i], channels[i], 3));
    embedding.blocks.push_back(nn::load_conv2d(weights, half, channels[i], channels[i + 1], 3, /*stride=*/2));
  }
  embedding.conv_out =
      nn::load_conv2d(weights, name + ".conv_out", channels.back(), config.unet.levels.front().channels, 3);
  return embedding;
}

}  // namespace

at::Tensor ConditionEmbedding::operator()(const at::Tensor& condition, const nn::Recorder& record) const {
  at::Tensor h = nn::silu(conv_in(condition, record));
  for (const nn::Conv2d& block : blocks) h = nn::silu(block(h, record));
  return record(name, conv_out(h, record));
}

ControlNet::ControlNet(const ControlNetConfig& config, nn::WeightReader& weights)
    : type_(weights.type()), config_(config) {
  encoder_ = load_encoder(weights, config_.unet);
  condition_embedding_ = load_condition_embedding(weights, config_);
  const std::vector<int64_t> channels = skip_channels(config_.unet.levels);
  for (size_t i = 0; i < channels.size(); ++i) {
    const std::string name = "controlnet_down_blocks." + std::to_string(i);
    controlnet_down_blocks_.push_back(nn::load_conv2d(weights, name, channels[i], channels[i], 1));
  }
  controlnet_mid_block_ =
      nn::load_conv2d(weights, "controlnet_mid_block", channels.back(), channels.back(), 1);
  count_ = weights.count();
}

ControlNet::ControlNet(const std::filesystem::path& folder, at::ScalarType type)
    : ControlNet(load_network<ControlNet>(open_controlnet(folder), type)) {}

at::Tensor ControlNet::hint(const at::Tensor& condition, const nn::Recorder& record) const {
  PATINA_CHECK_EQ(condition.dim(), 4);
  PATINA_CHECK_EQ(condition.size(1), config_.conditioning_channels);
  const at::Tensor ordered = config_.bgr ? condition.flip({1}) : condition;
  return condition_embedding_(
      ordered.to(encoder_.conv_in.weight.device(), type_).contiguous(at::MemoryFormat::ChannelsLast), record);
}

ControlResiduals ControlNet::operator()(const NetworkInputs& inputs, const at::Tensor& hint, float scale,
                                        const nn::Recorder& record) const {
  PATINA_CHECK_EQ(inputs.sample.dim(), 4);
  PATINA_CHECK_EQ(inputs.sample.size(1), config_.unet.in_channels);
  const c10::Device device = encoder_.conv_in.weight.device();
  const at::Tensor x = inputs.sample.to(device, type_).contiguous(at::MemoryFormat::ChannelsLast);
  const Conditions conditions = encoder_.conditions(inputs, record);
  auto [skips, mid] = encoder_(encoder_.conv_in(x, record) + hint, conditions);

  ControlResiduals residuals;
  for (size_t i = 0; i < skips.size(); ++i) {
    residuals.down.push_back(controlnet_down_blocks_[i](skips[i], record) * scale);
    skips[i].reset();
  }
  residuals.mid = controlnet_mid_block_(mid, record) * scale;
  return residuals;
}

ControlResiduals sum(ControlResiduals a, const ControlResiduals& b) {
  if (!a.mid.defined()) return b;
  if (!b.mid.defined()) return a;
  PATINA_CHECK_EQ(a.down.size(), b.down.size());
  for (size_t i = 0; i < a.down.size(); ++i) a.down[i] = a.down[i] + b.down[i];
  a.mid = a.mid + b.mid;
  return a;
}

}  // namespace patina::diffusion
