#include "patina/diffusion/files/ldm_names.h"

#include <utility>

#include "patina/base/check.h"
#include "patina/diffusion/files/unet_blocks.h"

namespace patina::diffusion {
namespace {

std::string join(const std::string& prefix, int64_t number, const std::string& rest = "") {
  return prefix + "." + std::to_string(number) + rest;
}

/// The name with its longest prefix in `names`, at a dot, replaced.
template <class Names>
std::optional<std::string> translate(const Names& names, std::string_view name) {
  for (size_t length = name.size();; length = name.rfind('.', length - 1)) {
    if (length == std::string_view::npos) return std::nullopt;
    if (const auto found = names.find(name.substr(0, length)); found != names.end())
      return found->second + std::string(name.substr(length));
    if (length == 0) return std::nullopt;
  }
}

void add_resnet(NameMap& names, const std::string& ldm, const std::string& diffusers) {
  names.add(ldm + ".in_layers.0", diffusers + ".norm1");
  names.add(ldm + ".in_layers.2", diffusers + ".conv1");
  names.add(ldm + ".emb_layers.1", diffusers + ".time_emb_proj");
  names.add(ldm + ".out_layers.0", diffusers + ".norm2");
  names.add(ldm + ".out_layers.3", diffusers + ".conv2");
  names.add(ldm + ".skip_connection", diffusers + ".conv_shortcut");
}

/// From the latents to the middle: what U-Nets and ControlNets share. LDM counts every layer and every
/// downsampler as a block of its own.
void add_encoder(NameMap& names, const std::vector<LevelConfig>& levels) {
  names.add("time_embed.0", "time_embedding.linear_1");
  names.add("time_embed.2", "time_embedding.linear_2");
  names.add("input_blocks.0.0", "conv_in");
  int64_t number = 1;
  for (const UNetBlock& block : down_blocks(levels)) {
    for (const UNetLayer& layer : block.layers) {
      add_resnet(names, join("input_blocks", number, ".0"), layer.resnet);
      if (layer.transformer) names.add(join("input_blocks", number, ".1"), *layer.transformer);
      ++number;
    }
    if (block.resampler) names.add(join("input_blocks", number++, ".0.op"), *block.resampler + ".conv");
  }
  const UNetBlock middle = mid_block(levels);
  add_resnet(names, "middle_block.0", middle.layers[0].resnet);
  names.add("middle_block.1", middle.layers[0].transformer.value());
  add_resnet(names, "middle_block.2", middle.layers[1].resnet);
}

void add_vae_resnet(NameMap& names, const std::string& ldm, const std::string& diffusers) {
  for (const char* same : {".norm1", ".conv1", ".norm2", ".conv2"}) names.add(ldm + same, diffusers + same);
  names.add(ldm + ".nin_shortcut", diffusers + ".conv_shortcut");
}

/// What the VAE's encoder and decoder have in common.
void add_vae_half(NameMap& names, const std::string& half) {
  names.add(half + ".conv_in", half + ".conv_in");
  add_vae_resnet(names, half + ".mid.block_1", half + ".mid_block.resnets.0");
  add_vae_resnet(names, half + ".mid.block_2", half + ".mid_block.resnets.1");
  const std::string ldm = half + ".mid.attn_1", diffusers = half + ".mid_block.attentions.0";
  names.add(ldm + ".norm", diffusers + ".group_norm");
  names.add(ldm + ".q", diffusers + ".to_q");
  names.add(ldm + ".k", diffusers + ".to_k");
  names.add(ldm + ".v", diffusers + ".to_v");
  names.add(ldm + ".proj_out", diffusers + ".to_out.0");
  names.add(half + ".norm_out", half + ".conv_norm_out");
  names.add(half + ".conv_out", half + ".conv_out");
}

}  // namespace

void NameMap::add(std::string ldm, std::string diffusers) {
  const bool fresh = diffusers_by_ldm_.emplace(ldm, diffusers).second &&
                     ldm_by_diffusers_.emplace(std::move(diffusers), std::move(ldm)).second;
  PATINA_CHECK(fresh);
}

std::optional<std::string> NameMap::to_diffusers(std::string_view ldm) const {
  return translate(diffusers_by_ldm_, ldm);
}
std::optional<std::string> NameMap::to_ldm(std::string_view diffusers) const {
  return translate(ldm_by_diffusers_, diffusers);
}

NameMap unet_names(const std::vector<LevelConfig>& levels) {
  NameMap names;
  add_encoder(names, levels);
  int64_t number = 0;
  for (const UNetBlock& block : up_blocks(levels)) {
    for (const UNetLayer& layer : block.layers) {
      add_resnet(names, join("output_blocks", number, ".0"), layer.resnet);
      if (layer.transformer) names.add(join("output_blocks", number, ".1"), *layer.transformer);
      ++number;
    }
    // The upsampler stands in the level's last block, behind the attention where there is one.
    if (block.resampler)
      names.add(join("output_blocks", number - 1, block.layers.back().transformer ? ".2.conv" : ".1.conv"),
                *block.resampler + ".conv");
  }
  names.add("out.0", "conv_norm_out");
  names.add("out.2", "conv_out");
  return names;
}

NameMap controlnet_names(const std::vector<LevelConfig>& levels, int64_t num_embedding_channels) {
  NameMap names;
  add_encoder(names, levels);
  // The hint's encoder: convolutions with an activation between any two.
  const std::string embedding = "controlnet_cond_embedding";
  const int64_t num_blocks = 2 * (num_embedding_channels - 1);
  names.add("input_hint_block.0", embedding + ".conv_in");
  for (int64_t i = 0; i < num_blocks; ++i)
    names.add(join("input_hint_block", 2 * (i + 1)), join(embedding + ".blocks", i));
  names.add(join("input_hint_block", 2 * (num_blocks + 1)), embedding + ".conv_out");
  // One convolution behind every kept output of the encoder.
  const auto num_kept = static_cast<int64_t>(skip_channels(levels).size());
  for (int64_t i = 0; i < num_kept; ++i)
    names.add(join("zero_convs", i, ".0"), join("controlnet_down_blocks", i));
  names.add("middle_block_out.0", "controlnet_mid_block");
  return names;
}

NameMap vae_names(int64_t num_levels, int64_t layers_per_block) {
  NameMap names;
  add_vae_half(names, "encoder");
  add_vae_half(names, "decoder");
  names.add("quant_conv", "quant_conv");
  names.add("post_quant_conv", "post_quant_conv");
  for (int64_t level = 0; level < num_levels; ++level) {
    const std::string ldm_down = join("encoder.down", level), down = join("encoder.down_blocks", level);
    const std::string ldm_up = join("decoder.up", num_levels - 1 - level),
                      up = join("decoder.up_blocks", level);
    for (int64_t layer = 0; layer < layers_per_block; ++layer)
      add_vae_resnet(names, join(ldm_down + ".block", layer), join(down + ".resnets", layer));
    for (int64_t layer = 0; layer <= layers_per_block; ++layer)
      add_vae_resnet(names, join(ldm_up + ".block", layer), join(up + ".resnets", layer));
    if (level + 1 < num_levels) {
      names.add(ldm_down + ".downsample.conv", down + ".downsamplers.0.conv");
      names.add(ldm_up + ".upsample.conv", up + ".upsamplers.0.conv");
    }
  }
  return names;
}

NameMap openclip_names(int64_t num_layers) {
  NameMap names;
  names.add("token_embedding", "text_model.embeddings.token_embedding");
  names.add("positional_embedding", "text_model.embeddings.position_embedding.weight");
  names.add("ln_final", "text_model.final_layer_norm");
  for (int64_t i = 0; i < num_layers; ++i) {
    const std::string ldm = join("transformer.resblocks", i), layer = join("text_model.encoder.layers", i);
    names.add(ldm + ".ln_1", layer + ".layer_norm1");
    names.add(ldm + ".ln_2", layer + ".layer_norm2");
    names.add(ldm + ".attn.out_proj", layer + ".self_attn.out_proj");
    names.add(ldm + ".mlp.c_fc", layer + ".mlp.fc1");
    names.add(ldm + ".mlp.c_proj", layer + ".mlp.fc2");
    // For what stands inside: the fused projections keep their last part.
    names.add(ldm, layer);
  }
  return names;
}

std::vector<LevelConfig> levels_of_ldm(const HasPrefix& has) {
  std::vector<LevelConfig> levels(1);
  levels.back().num_layers = 0;
  for (int64_t block = 1; has(join("input_blocks", block, ".")); ++block) {
    if (has(join("input_blocks", block, ".0.op."))) {
      levels.emplace_back().num_layers = 0;
      continue;
    }
    ++levels.back().num_layers;
    if (has(join("input_blocks", block, ".1."))) levels.back().down_attention = true;
  }
  int64_t block = 0;
  for (auto level = levels.rbegin(); level != levels.rend(); ++level) {
    for (int64_t layer = 0; layer <= level->num_layers; ++layer, ++block) {
      // A level's last block may hold an upsampler in the place of an attention.
      if (has(join("output_blocks", block, ".1.transformer_blocks."))) level->up_attention = true;
    }
  }
  return levels;
}

}  // namespace patina::diffusion
