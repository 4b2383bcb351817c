#include "patina/diffusion/networks/unet.h"

#include <cmath>

#include <ATen/ATen.h>

#include "patina/base/check.h"
#include "patina/diffusion/files/unet_blocks.h"
#include "patina/diffusion/networks/component.h"

namespace patina::diffusion {
namespace {

constexpr int64_t kTimeFactor = 4;  // width of the time embedding over that of the finest level

int64_t time_width(const UNetConfig& config) {
  return kTimeFactor * config.levels.front().channels;
}

ResnetBlock load_unet_resnet(nn::WeightReader& weights, const UNetLayer& layer, const UNetConfig& config) {
  return load_resnet(weights, layer.resnet, layer.in_channels + layer.skip_channels, layer.out_channels,
                     time_width(config), config.norm_num_groups, config.norm_epsilon);
}

/// Residual blocks and transformers of a block on the way down or up.
template <class Block>
Block load_layers(nn::WeightReader& weights, const UNetBlock& plan, const UNetConfig& config) {
  Block block;
  block.name = plan.name;
  for (const UNetLayer& layer : plan.layers) {
    block.resnets.push_back(load_unet_resnet(weights, layer, config));
    if (layer.transformer)
      block.attentions.push_back(
          load_transformer(weights, *layer.transformer, config.levels[plan.level], config));
  }
  return block;
}

DownBlock load_down_block(nn::WeightReader& weights, const UNetBlock& plan, const UNetConfig& config) {
  auto block = load_layers<DownBlock>(weights, plan, config);
  const int64_t channels = config.levels[plan.level].channels;
  if (plan.resampler)
    block.downsamplers_0 =
        Downsample{*plan.resampler, nn::load_conv2d(weights, *plan.resampler + ".conv", channels, channels, 3,
                                                    /*stride=*/2)};
  return block;
}

MidBlock load_mid_block(nn::WeightReader& weights, const UNetBlock& plan, const UNetConfig& config) {
  return {plan.name, load_unet_resnet(weights, plan.layers[0], config),
          load_transformer(weights, plan.layers[0].transformer.value(), config.levels[plan.level], config),
          load_unet_resnet(weights, plan.layers[1], config)};
}

UpBlock load_up_block(nn::WeightReader& weights, const UNetBlock& plan, const UNetConfig& config) {
  auto block = load_layers<UpBlock>(weights, plan, config);
  const int64_t channels = config.levels[plan.level].channels;
  if (plan.resampler)
    block.upsamplers_0 =
        Upsample{*plan.resampler, nn::load_conv2d(weights, *plan.resampler + ".conv", channels, channels, 3)};
  return block;
}

}  // namespace

at::Tensor timestep_embedding(const at::Tensor& timesteps, int64_t width, bool flip_sin_to_cos,
                              double freq_shift) {
  const int64_t half = width / 2;
  const at::Tensor exponents = -std::log(10000.0) * at::arange(half, timesteps.options().dtype(at::kFloat)) /
                               (static_cast<double>(half) - freq_shift);
  const at::Tensor angles = timesteps.to(at::kFloat).unsqueeze(1) * at::exp(exponents).unsqueeze(0);
  const at::Tensor sines = at::sin(angles), cosines = at::cos(angles);
  const at::Tensor embedding = flip_sin_to_cos ? at::cat({cosines, sines}, 1) : at::cat({sines, cosines}, 1);
  return width % 2 ? at::constant_pad_nd(embedding, {0, 1}) : embedding;
}

Encoder load_encoder(nn::WeightReader& weights, const UNetConfig& config) {
  const int64_t finest = config.levels.front().channels, time = time_width(config);
  Encoder encoder;
  encoder.config = config;
  encoder.conv_in = nn::load_conv2d(weights, "conv_in", config.in_channels, finest, config.conv_in_kernel);
  encoder.time_embedding = {nn::load_linear(weights, "time_embedding.linear_1", finest, time),
                            nn::load_linear(weights, "time_embedding.linear_2", time, time)};
  for (const UNetBlock& plan : down_blocks(config.levels))
    encoder.down_blocks.push_back(load_down_block(weights, plan, config));
  encoder.mid_block = load_mid_block(weights, mid_block(config.levels), config);
  return encoder;
}

at::Tensor Encoder::time(const at::Tensor& timesteps, const nn::Recorder& record) const {
  const at::Tensor sinusoids =
      timestep_embedding(timesteps.to(conv_in.weight.device()), config.levels.front().channels,
                         config.flip_sin_to_cos, config.freq_shift);
  const at::Tensor projected = record("time_proj", sinusoids).to(conv_in.weight.scalar_type());
  const at::Tensor hidden = nn::silu(time_embedding.linear_1(projected, record));
  return nn::silu(record("time_embedding", time_embedding.linear_2(hidden, record)));
}

Conditions Encoder::conditions(const NetworkInputs& inputs, const nn::Recorder& record) const {
  const at::TensorOptions options = conv_in.weight.options();
  std::vector<at::Tensor> texts{inputs.text.tokens.to(options)};
  for (const TextConditioning& text : inputs.part_texts) texts.push_back(text.tokens.to(options));
  return {time(inputs.timesteps, record),
          std::move(texts),
          inputs.part_levels,
          inputs.bias,
          inputs.references,
          record};
}

Encoder::Outputs Encoder::operator()(const at::Tensor& x, const Conditions& conditions) const {
  const nn::Recorder& record = conditions.record;
  Outputs outputs{{x}, {}};
  at::Tensor h = x;
  for (const DownBlock& block : down_blocks) {
    for (size_t i = 0; i < block.resnets.size(); ++i) {
      h = block.resnets[i](h, conditions.time, record);
      if (!block.attentions.empty()) h = block.attentions[i](h, conditions);
      outputs.skips.push_back(h);
    }
    if (block.downsamplers_0) {
      h = (*block.downsamplers_0)(h, record);
      outputs.skips.push_back(h);
    }
    record(block.name, h);
  }
  h = mid_block.resnets_0(h, conditions.time, record);
  h = mid_block.attentions_0(h, conditions);
  outputs.mid = record(mid_block.name, mid_block.resnets_1(h, conditions.time, record));
  return outputs;
}

UNet::UNet(const UNetConfig& config, nn::WeightReader& weights) : type_(weights.type()) {
  encoder_ = load_encoder(weights, config);
  for (const UNetBlock& plan : up_blocks(config.levels))
    up_blocks_.push_back(load_up_block(weights, plan, config));
  const int64_t finest = config.levels.front().channels;
  conv_norm_out_ =
      nn::load_group_norm(weights, "conv_norm_out", finest, config.norm_num_groups, config.norm_epsilon);
  conv_out_ = nn::load_conv2d(weights, "conv_out", finest, config.out_channels, config.conv_out_kernel);
  count_ = weights.count();
}

UNet::UNet(const std::filesystem::path& folder, at::ScalarType type)
    : UNet(load_network<UNet>(open_unet(folder), type)) {}

at::Tensor UNet::operator()(const NetworkInputs& inputs, ControlResiduals control,
                            const nn::Recorder& record) const {
  const UNetConfig& config = encoder_.config;
  PATINA_CHECK_EQ(inputs.sample.dim(), 4);
  PATINA_CHECK_EQ(inputs.sample.size(1), config.in_channels);
  PATINA_CHECK_EQ(inputs.text.tokens.dim(), 3);

  // Down, keeping every layer's output; ControlNets add to what was kept.
  const c10::Device device = encoder_.conv_in.weight.device();
  at::Tensor sample = inputs.sample.to(device, type_).contiguous(at::MemoryFormat::ChannelsLast);
  if (config.center_input_sample) sample = 2 * sample - 1;
  const Conditions conditions = encoder_.conditions(inputs, record);
  auto [skips, h] = encoder_(encoder_.conv_in(sample, record), conditions);
  if (control.mid.defined()) {
    PATINA_CHECK_EQ(control.down.size(), skips.size());
    for (size_t i = 0; i < skips.size(); ++i) {
      skips[i] = skips[i] + control.down[i];
      control.down[i].reset();
    }
    h = h + control.mid;
  }

  // Up, taking the kept outputs last first.
  for (const UpBlock& block : up_blocks_) {
    for (size_t i = 0; i < block.resnets.size(); ++i) {
      h = at::cat({h, skips.back()}, 1);
      skips.pop_back();
      h = block.resnets[i](h, conditions.time, record);
      if (!block.attentions.empty()) h = block.attentions[i](h, conditions);
    }
    // To the size of the next kept output, which is not twice this one where the way down rounded up.
    if (block.upsamplers_0) h = (*block.upsamplers_0)(h, skips.back().size(2), skips.back().size(3), record);
    record(block.name, h);
  }
  return conv_out_(conv_norm_out_.with_silu(h, record), record);
}

}  // namespace patina::diffusion
