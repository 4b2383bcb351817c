#include "patina/diffusion/networks/vae.h"

#include <ATen/ATen.h>

#include "patina/base/check.h"
#include "patina/diffusion/networks/component.h"

namespace patina::diffusion {
namespace {

constexpr double kEpsilon = 1e-6;  // of every norm of the VAE; no configuration names it

ResnetBlock load_vae_resnet(nn::WeightReader& weights, const std::string& name, int64_t in, int64_t out,
                            const VaeConfig& config) {
  return load_resnet(weights, name, in, out, /*time_width=*/0, config.norm_num_groups, kEpsilon);
}

VaeAttention load_vae_attention(nn::WeightReader& weights, const std::string& name, int64_t channels,
                                const VaeConfig& config) {
  // Files from before diffusers 0.15, SD 1.5's own among them, have other names for the same layers.
  const bool old_names = weights.has(name + ".proj_attn.weight");
  const auto linear = [&](const char* today, const char* old) {
    return nn::load_linear(weights, name + "." + (old_names ? old : today), channels, channels);
  };
  return {name,
          nn::load_group_norm(weights, name + ".group_norm", channels, config.norm_num_groups, kEpsilon),
          linear("to_q", "query"),
          linear("to_k", "key"),
          linear("to_v", "value"),
          linear("to_out.0", "proj_attn")};
}

VaeMidBlock load_mid_block(nn::WeightReader& weights, const std::string& name, const VaeConfig& config) {
  const int64_t channels = config.block_out_channels.back();
  VaeMidBlock block;
  block.name = name;
  block.resnets_0 = load_vae_resnet(weights, name + ".resnets.0", channels, channels, config);
  if (config.mid_attention)
    block.attentions_0 = load_vae_attention(weights, name + ".attentions.0", channels, config);
  block.resnets_1 = load_vae_resnet(weights, name + ".resnets.1", channels, channels, config);
  return block;
}

VaeBlock load_block(nn::WeightReader& weights, const std::string& name, int64_t in, int64_t out,
                    int64_t num_layers, const VaeConfig& config) {
  VaeBlock block;
  block.name = name;
  for (int64_t i = 0; i < num_layers; ++i) {
    block.resnets.push_back(
        load_vae_resnet(weights, name + ".resnets." + std::to_string(i), i == 0 ? in : out, out, config));
  }
  return block;
}

VaeEncoder load_vae_encoder(nn::WeightReader& weights, const VaeConfig& config) {
  const std::vector<int64_t>& channels = config.block_out_channels;
  VaeEncoder encoder;
  encoder.conv_in = nn::load_conv2d(weights, "encoder.conv_in", config.in_channels, channels.front(), 3);
  for (size_t i = 0; i < channels.size(); ++i) {
    const std::string name = "encoder.down_blocks." + std::to_string(i);
    VaeBlock block =
        load_block(weights, name, channels[i > 0 ? i - 1 : 0], channels[i], config.layers_per_block, config);
    if (i + 1 < channels.size()) {
      nn::Conv2d conv =
          nn::load_conv2d(weights, name + ".downsamplers.0.conv", channels[i], channels[i], 3, /*stride=*/2);
      conv.padding = 0;  // the block pads below and right only
      block.downsamplers_0 = Downsample{name + ".downsamplers.0", conv};
    }
    encoder.down_blocks.push_back(std::move(block));
  }
  encoder.mid_block = load_mid_block(weights, "encoder.mid_block", config);
  encoder.conv_norm_out = nn::load_group_norm(weights, "encoder.conv_norm_out", channels.back(),
                                              config.norm_num_groups, kEpsilon);
  encoder.conv_out =
      nn::load_conv2d(weights, "encoder.conv_out", channels.back(), 2 * config.latent_channels, 3);
  return encoder;
}

VaeDecoder load_vae_decoder(nn::WeightReader& weights, const VaeConfig& config) {
  const std::vector<int64_t> channels(config.block_out_channels.rbegin(), config.block_out_channels.rend());
  VaeDecoder decoder;
  decoder.conv_in = nn::load_conv2d(weights, "decoder.conv_in", config.latent_channels, channels.front(), 3);
  decoder.mid_block = load_mid_block(weights, "decoder.mid_block", config);
  for (size_t i = 0; i < channels.size(); ++i) {
    const std::string name = "decoder.up_blocks." + std::to_string(i);
    VaeBlock block = load_block(weights, name, channels[i > 0 ? i - 1 : 0], channels[i],
                                config.layers_per_block + 1, config);
    if (i + 1 < channels.size()) {
      block.upsamplers_0 =
          Upsample{name + ".upsamplers.0",
                   nn::load_conv2d(weights, name + ".upsamplers.0.conv", channels[i], channels[i], 3)};
    }
    decoder.up_blocks.push_back(std::move(block));
  }
  decoder.conv_norm_out = nn::load_group_norm(weights, "decoder.conv_norm_out", channels.back(),
                                              config.norm_num_groups, kEpsilon);
  decoder.conv_out = nn::load_conv2d(weights, "decoder.conv_out", channels.back(), config.out_channels, 3);
  return decoder;
}

}  // namespace

at::Tensor VaeAttention::operator()(const at::Tensor& x, const nn::Recorder& record) const {
  const at::Tensor tokens = nn::tokens_from_image(group_norm(x, record));
  const at::Tensor attended =
      nn::attend(to_q(tokens, record), to_k(tokens, record), to_v(tokens, record), /*num_heads=*/1);
  return record(name, nn::image_from_tokens(to_out_0(attended, record), x.size(2), x.size(3)) + x);
}

at::Tensor VaeMidBlock::operator()(const at::Tensor& x, const nn::Recorder& record) const {
  at::Tensor h = resnets_0(x, {}, record);
  if (attentions_0) h = (*attentions_0)(h, record);
  return record(name, resnets_1(h, {}, record));
}

at::Tensor VaeBlock::operator()(const at::Tensor& x, const nn::Recorder& record) const {
  at::Tensor h = x;
  for (const ResnetBlock& resnet : resnets) h = resnet(h, {}, record);
  if (downsamplers_0) h = (*downsamplers_0)(at::constant_pad_nd(h, {0, 1, 0, 1}), record);
  if (upsamplers_0) h = (*upsamplers_0)(h, 2 * h.size(2), 2 * h.size(3), record);
  return record(name, h);
}

Vae::Vae(const VaeConfig& config, nn::WeightReader& weights) : type_(weights.type()), config_(config) {
  encoder_ = load_vae_encoder(weights, config_);
  const int64_t latent = config_.latent_channels;
  if (config_.quant_conv) quant_conv_ = nn::load_conv2d(weights, "quant_conv", 2 * latent, 2 * latent, 1);
  if (config_.post_quant_conv)
    post_quant_conv_ = nn::load_conv2d(weights, "post_quant_conv", latent, latent, 1);
  decoder_ = load_vae_decoder(weights, config_);
  count_ = weights.count();
}

Vae::Vae(const std::filesystem::path& folder, at::ScalarType type)
    : Vae(load_network<Vae>(open_vae(folder), type)) {}

Posterior Vae::encode(const at::Tensor& image, const nn::Recorder& record) const {
  PATINA_CHECK_EQ(image.dim(), 4);
  PATINA_CHECK(image.size(2) % config_.latent_scale() == 0 && image.size(3) % config_.latent_scale() == 0);
  at::Tensor h = encoder_.conv_in(
      image.to(encoder_.conv_in.weight.device(), type_).contiguous(at::MemoryFormat::ChannelsLast), record);
  for (const VaeBlock& block : encoder_.down_blocks) h = block(h, record);
  h = encoder_.mid_block(h, record);
  at::Tensor moments = encoder_.conv_out(encoder_.conv_norm_out.with_silu(h, record), record);
  if (quant_conv_) moments = (*quant_conv_)(moments, record);
  const std::vector<at::Tensor> halves = moments.to(at::kFloat).chunk(2, 1);
  return {halves[0], at::clamp(halves[1], -30.0, 20.0)};
}

at::Tensor Vae::decode(const at::Tensor& latents, const nn::Recorder& record) const {
  PATINA_CHECK_EQ(latents.dim(), 4);
  PATINA_CHECK_EQ(latents.size(1), config_.latent_channels);
  at::Tensor h =
      latents.to(decoder_.conv_in.weight.device(), type_).contiguous(at::MemoryFormat::ChannelsLast);
  if (post_quant_conv_) h = (*post_quant_conv_)(h, record);
  h = decoder_.mid_block(decoder_.conv_in(h, record), record);
  for (const VaeBlock& block : decoder_.up_blocks) h = block(h, record);
  return decoder_.conv_out(decoder_.conv_norm_out.with_silu(h, record), record).to(at::kFloat);
}

}  // namespace patina::diffusion
