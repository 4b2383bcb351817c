#include "patina/diffusion/files/infer_config.h"

#include <algorithm>

#include "patina/base/error.h"
#include "patina/diffusion/files/families.h"
#include "patina/diffusion/files/unet_blocks.h"

namespace patina::diffusion {
namespace {

constexpr int64_t kNumGroups = 32;      // of every group norm
constexpr int64_t kClipHeadWidth = 64;  // of CLIP's text encoders, all of them

/// How many of "<prefix>0.", "<prefix>1.", … there are.
int64_t count(const TensorTable& table, const std::string& prefix) {
  int64_t number = 0;
  while (table.has_prefix(prefix + std::to_string(number) + ".")) ++number;
  return number;
}

[[noreturn]] void unsupported(const TensorTable& table, const std::string& message) {
  throw Error(ErrorCode::kUnsupported, table.where.string(), message);
}

void check_channels(const TensorTable& table, int64_t channels, int64_t divisor, const std::string& of_what) {
  if (channels <= 0 || channels % divisor != 0)
    unsupported(table, "its " + std::string(name_of(table.network)) + " has " + std::to_string(channels) +
                           " channels, which cannot be divided into " + of_what + " as in " + kFamilyNames +
                           "; a config.json beside it could tell other sizes");
}

/// The way down and the middle: what U-Nets and ControlNets share.
UNetConfig infer_encoder(const TensorTable& table) {
  UNetConfig config;
  config.norm_num_groups = kNumGroups;
  config.in_channels = size_of(table, "conv_in.weight", 1);
  config.conv_in_kernel = size_of(table, "conv_in.weight", 2);
  const std::string middle = "mid_block.attentions.0.";
  const auto proj_in = table.tensors.find(middle + "proj_in.weight");
  config.use_linear_projection = proj_in != table.tensors.end() && proj_in->second.entry.shape.size() == 2;
  const int64_t text_width = size_of(table, middle + "transformer_blocks.0.attn2.to_k.weight", 1);

  const FamilyTraits& family = traits_of(family_of(config));

  const auto num_levels = static_cast<size_t>(count(table, "down_blocks."));
  if (num_levels == 0) size_of(table, "down_blocks.0.resnets.0.conv1.bias", 0);  // throws: there is none
  for (size_t i = 0; i < num_levels; ++i) {
    const std::string down = down_block_name(i) + ".";
    LevelConfig level;
    level.num_layers = count(table, down + "resnets.");
    level.channels = size_of(table, down + "resnets.0.conv1.bias", 0);
    level.cross_attention_dim = text_width;
    level.down_attention = table.has_prefix(down + "attentions.");
    level.num_transformer_layers = level.down_attention
                                       ? count(table, down + "attentions.0.transformer_blocks.")
                                       : count(table, middle + "transformer_blocks.");
    level.up_attention = table.has_prefix(up_block_name(i, num_levels) + ".attentions.");
    check_channels(table, level.channels, kNumGroups, "32 groups");
    if (family.head_width > 0)
      check_channels(table, level.channels, family.head_width,
                     "heads of " + std::to_string(family.head_width));
    level.num_heads = family.head_width > 0 ? level.channels / family.head_width : family.num_heads;
    config.levels.push_back(level);
  }
  return config;
}

}  // namespace

UNetConfig infer_unet_config(const TensorTable& table) {
  UNetConfig config = infer_encoder(table);
  config.out_channels = size_of(table, "conv_out.weight", 0);
  config.conv_out_kernel = size_of(table, "conv_out.weight", 2);
  return config;
}

ControlNetConfig infer_controlnet_config(const TensorTable& table) {
  ControlNetConfig config{infer_encoder(table), 3, {}, false};
  const std::string embedding = "controlnet_cond_embedding.";
  config.conditioning_channels = size_of(table, embedding + "conv_in.weight", 1);
  config.embedding_channels.push_back(size_of(table, embedding + "conv_in.weight", 0));
  // Every second convolution widens and halves the resolution.
  for (int64_t block = 1; block < count(table, embedding + "blocks."); block += 2)
    config.embedding_channels.push_back(
        size_of(table, embedding + "blocks." + std::to_string(block) + ".weight", 0));
  return config;
}

VaeConfig infer_vae_config(const TensorTable& table) {
  VaeConfig config;
  config.norm_num_groups = kNumGroups;
  config.in_channels = size_of(table, "encoder.conv_in.weight", 1);
  config.out_channels = size_of(table, "decoder.conv_out.weight", 0);
  config.latent_channels = size_of(table, "decoder.conv_in.weight", 1);
  if (config.latent_channels == 16)
    unsupported(
        table,
        std::string("is a VAE with 16 latent channels, as Stable Diffusion 3 and Flux have; expected 4 as "
                    "in ") +
            kFamilyNames);
  const int64_t num_levels = count(table, "encoder.down_blocks.");
  for (int64_t i = 0; i < std::max<int64_t>(num_levels, 1); ++i) {
    config.block_out_channels.push_back(
        size_of(table, "encoder.down_blocks." + std::to_string(i) + ".resnets.0.conv1.bias", 0));
    check_channels(table, config.block_out_channels.back(), kNumGroups, "32 groups");
  }
  config.layers_per_block = count(table, "encoder.down_blocks.0.resnets.");
  config.mid_attention = table.has_prefix("decoder.mid_block.attentions.");
  config.quant_conv = table.has_prefix("quant_conv.");
  config.post_quant_conv = table.has_prefix("post_quant_conv.");
  return config;
}

TextEncoderConfig infer_text_encoder_config(const TensorTable& table) {
  TextEncoderConfig config;
  const std::string embeddings = "text_model.embeddings.", layers = "text_model.encoder.layers.";
  config.vocab_size = size_of(table, embeddings + "token_embedding.weight", 0);
  config.hidden_size = size_of(table, embeddings + "token_embedding.weight", 1);
  config.max_positions = size_of(table, embeddings + "position_embedding.weight", 0);
  config.num_layers = count(table, layers);
  config.intermediate_size = size_of(table, layers + "0.mlp.fc1.weight", 0);
  check_channels(table, config.hidden_size, kClipHeadWidth, "heads of 64");
  config.num_heads = config.hidden_size / kClipHeadWidth;
  // The end token is the last one of CLIP's vocabulary.
  config.eos_token_id = config.vocab_size - 1;
  config.activation = traits_of(family_of_text_encoder(table.naming, config.hidden_size)).activation;
  return config;
}

}  // namespace patina::diffusion
