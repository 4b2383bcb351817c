// The config.json files of a diffusers model folder as plain structs. Keys that are absent get diffusers'
// defaults; settings that would change a network in a way patina does not have are refused by name. No Torch
// here.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace patina::diffusion {

/// One resolution of a U-Net.
struct LevelConfig {
  int64_t channels = 0;
  int64_t num_layers = 2;  // resnets on the way down; one more on the way up
  int64_t num_heads = 8;
  int64_t num_transformer_layers = 1;
  int64_t cross_attention_dim = 0;  // width of the text tokens
  bool down_attention = false, up_attention = false;
};

struct UNetConfig {
  int64_t in_channels = 4, out_channels = 4;
  std::vector<LevelConfig> levels;  // finest first
  int64_t norm_num_groups = 32;
  double norm_epsilon = 1e-5;
  bool use_linear_projection =
      false;                    // proj_in and proj_out are linear layers, not 1×1 convolutions (SD 2.x)
  bool flip_sin_to_cos = true;  // time embedding: cosines first
  double freq_shift = 0;
  bool center_input_sample = false;  // x -> 2x - 1
  int64_t conv_in_kernel = 3, conv_out_kernel = 3;
};

struct ControlNetConfig {
  UNetConfig unet;  // of the copied encoder; up_attention is not used
  int64_t conditioning_channels = 3;
  std::vector<int64_t> embedding_channels;  // of the hint's encoder, finest first
  bool bgr = false;                         // the hint's channels are wanted in reverse order
};

struct VaeConfig {
  int64_t in_channels = 3, out_channels = 3, latent_channels = 4;
  std::vector<int64_t> block_out_channels;  // finest first
  int64_t layers_per_block = 1;
  int64_t norm_num_groups = 32;
  double scaling_factor = 0.18215;  // brings latents to unit variance
  bool mid_attention = true, quant_conv = true, post_quant_conv = true;

  /// Image pixels a latent pixel.
  int64_t latent_scale() const { return int64_t{1} << (block_out_channels.size() - 1); }
};

enum class TextActivation { kQuickGelu, kGelu };

struct TextEncoderConfig {
  int64_t vocab_size = 49408, hidden_size = 512, intermediate_size = 2048;
  int64_t num_layers = 12, num_heads = 8, max_positions = 77;
  int64_t eos_token_id = 49407;
  double layer_norm_epsilon = 1e-5;
  TextActivation activation = TextActivation::kQuickGelu;
};

/// Each reads <folder>/config.json. Throws Error{kNotFound, kFormat, kUnsupported} with the file and key,
/// expected and found.
UNetConfig read_unet_config(const std::filesystem::path& folder);
ControlNetConfig read_controlnet_config(const std::filesystem::path& folder);
VaeConfig read_vae_config(const std::filesystem::path& folder);
TextEncoderConfig read_text_encoder_config(const std::filesystem::path& folder);

}  // namespace patina::diffusion
