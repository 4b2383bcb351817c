#include "make_checkpoint/configs.h"

#include <nlohmann/json.hpp>

namespace patina::make_checkpoint {
namespace {

using nlohmann::json;

json encoder_json(const diffusion::UNetConfig& config) {
  json channels = json::array(), heads = json::array(), blocks = json::array();
  for (const diffusion::LevelConfig& level : config.levels) {
    channels.push_back(level.channels);
    heads.push_back(level.num_heads);
    blocks.push_back(level.down_attention ? "CrossAttnDownBlock2D" : "DownBlock2D");
  }
  return {{"act_fn", "silu"},
          {"attention_head_dim", heads},
          {"block_out_channels", channels},
          {"cross_attention_dim", config.levels.front().cross_attention_dim},
          {"down_block_types", blocks},
          {"in_channels", config.in_channels},
          {"layers_per_block", config.levels.front().num_layers},
          {"norm_eps", config.norm_epsilon},
          {"norm_num_groups", config.norm_num_groups},
          {"use_linear_projection", config.use_linear_projection}};
}

}  // namespace

Configs configs_of(Family family, Size size, int64_t vocabulary) {
  const bool full = size == Size::kFull, sd2 = family == Family::kSd2;
  const diffusion::FamilyTraits& traits = diffusion::traits_of(family);
  Configs configs;
  configs.family = family;

  diffusion::TextEncoderConfig& text = configs.text_encoder;
  text.vocab_size = vocabulary > 0 ? vocabulary : 49408;
  text.eos_token_id = text.vocab_size - 1;
  text.hidden_size = full ? traits.text_width : 128;
  text.intermediate_size = 4 * text.hidden_size;
  text.num_layers = full ? (sd2 ? 23 : 12) : 2;
  text.num_heads = text.hidden_size / 64;
  text.activation = traits.activation;

  diffusion::UNetConfig& unet = configs.unet;
  unet.use_linear_projection = traits.linear_projection;
  const std::vector<int64_t> channels = full  ? std::vector<int64_t>{320, 640, 1280, 1280}
                                        : sd2 ? std::vector<int64_t>{64, 64, 128, 128}
                                              : std::vector<int64_t>{32, 64, 64, 96};
  for (size_t i = 0; i < channels.size(); ++i) {
    const bool attention = i + 1 < channels.size();
    const int64_t heads = traits.head_width > 0 ? channels[i] / traits.head_width : traits.num_heads;
    unet.levels.push_back({channels[i], 2, heads, 1, text.hidden_size, attention, attention});
  }

  configs.controlnet.unet = unet;
  for (diffusion::LevelConfig& level : configs.controlnet.unet.levels) level.up_attention = false;
  configs.controlnet.embedding_channels =
      full ? std::vector<int64_t>{16, 32, 96, 256} : std::vector<int64_t>{8, 8, 16, 16};

  configs.vae.layers_per_block = full ? 2 : 1;
  configs.vae.block_out_channels =
      full ? std::vector<int64_t>{128, 256, 512, 512} : std::vector<int64_t>{32, 32, 64, 64};
  return configs;
}

std::string config_json(const diffusion::UNetConfig& config) {
  json object = encoder_json(config);
  json blocks = json::array();
  for (auto level = config.levels.rbegin(); level != config.levels.rend(); ++level)
    blocks.push_back(level->up_attention ? "CrossAttnUpBlock2D" : "UpBlock2D");
  object["_class_name"] = "UNet2DConditionModel";
  object["out_channels"] = config.out_channels;
  object["up_block_types"] = blocks;
  return object.dump(2);
}

std::string config_json(const diffusion::ControlNetConfig& config) {
  json object = encoder_json(config.unet);
  object["_class_name"] = "ControlNetModel";
  object["conditioning_embedding_out_channels"] = config.embedding_channels;
  object["controlnet_conditioning_channel_order"] = config.bgr ? "bgr" : "rgb";
  return object.dump(2);
}

std::string config_json(const diffusion::VaeConfig& config) {
  const size_t levels = config.block_out_channels.size();
  return json{{"_class_name", "AutoencoderKL"},
              {"act_fn", "silu"},
              {"block_out_channels", config.block_out_channels},
              {"down_block_types", std::vector<std::string>(levels, "DownEncoderBlock2D")},
              {"up_block_types", std::vector<std::string>(levels, "UpDecoderBlock2D")},
              {"in_channels", config.in_channels},
              {"latent_channels", config.latent_channels},
              {"layers_per_block", config.layers_per_block},
              {"norm_num_groups", config.norm_num_groups},
              {"out_channels", config.out_channels},
              {"scaling_factor", config.scaling_factor}}
      .dump(2);
}

std::string config_json(const diffusion::TextEncoderConfig& config) {
  return json{{"architectures", {"CLIPTextModel"}},
              {"eos_token_id", config.eos_token_id},
              {"hidden_act", config.activation == diffusion::TextActivation::kGelu ? "gelu" : "quick_gelu"},
              {"hidden_size", config.hidden_size},
              {"intermediate_size", config.intermediate_size},
              {"layer_norm_eps", config.layer_norm_epsilon},
              {"max_position_embeddings", config.max_positions},
              {"model_type", "clip_text_model"},
              {"num_attention_heads", config.num_heads},
              {"num_hidden_layers", config.num_layers},
              {"vocab_size", config.vocab_size}}
      .dump(2);
}

}  // namespace patina::make_checkpoint
