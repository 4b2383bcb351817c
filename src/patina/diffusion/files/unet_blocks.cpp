#include "patina/diffusion/files/unet_blocks.h"

namespace patina::diffusion {
namespace {

UNetLayer layer_of(const std::string& block, int64_t index, int64_t in, const LevelConfig& level,
                   bool attention) {
  const std::string number = std::to_string(index);
  UNetLayer layer{block + ".resnets." + number, in, 0, level.channels, std::nullopt};
  if (attention) layer.transformer = block + ".attentions." + number;
  return layer;
}

}  // namespace

std::string down_block_name(size_t level) {
  return "down_blocks." + std::to_string(level);
}

std::string up_block_name(size_t level, size_t num_levels) {
  return "up_blocks." + std::to_string(num_levels - 1 - level);
}

std::vector<UNetBlock> down_blocks(std::span<const LevelConfig> levels) {
  std::vector<UNetBlock> blocks;
  int64_t in = levels.front().channels;
  for (size_t i = 0; i < levels.size(); ++i) {
    UNetBlock block{down_block_name(i), i, {}, std::nullopt};
    for (int64_t layer = 0; layer < levels[i].num_layers; ++layer) {
      block.layers.push_back(layer_of(block.name, layer, in, levels[i], levels[i].down_attention));
      in = levels[i].channels;
    }
    if (i + 1 < levels.size()) block.resampler = block.name + ".downsamplers.0";
    blocks.push_back(std::move(block));
  }
  return blocks;
}

UNetBlock mid_block(std::span<const LevelConfig> levels) {
  const LevelConfig& coarsest = levels.back();
  const std::string name = "mid_block";
  return {name,
          levels.size() - 1,
          {layer_of(name, 0, coarsest.channels, coarsest, /*attention=*/true),
           layer_of(name, 1, coarsest.channels, coarsest, /*attention=*/false)},
          std::nullopt};
}

std::vector<UNetBlock> up_blocks(std::span<const LevelConfig> levels) {
  std::vector<int64_t> kept = skip_channels(levels);
  std::vector<UNetBlock> blocks;
  int64_t in = levels.back().channels;
  for (size_t i = levels.size(); i-- > 0;) {
    UNetBlock block{up_block_name(i, levels.size()), i, {}, std::nullopt};
    for (int64_t layer = 0; layer <= levels[i].num_layers; ++layer) {
      block.layers.push_back(layer_of(block.name, layer, in, levels[i], levels[i].up_attention));
      block.layers.back().skip_channels = kept.back();
      kept.pop_back();
      in = levels[i].channels;
    }
    if (i > 0) block.resampler = block.name + ".upsamplers.0";
    blocks.push_back(std::move(block));
  }
  return blocks;
}

std::vector<int64_t> skip_channels(std::span<const LevelConfig> levels) {
  std::vector<int64_t> channels{levels.front().channels};
  for (const UNetBlock& block : down_blocks(levels)) {
    for (const UNetLayer& layer : block.layers) channels.push_back(layer.out_channels);
    if (block.resampler) channels.push_back(levels[block.level].channels);
  }
  return channels;
}

std::vector<LatentSize> level_sizes(LatentSize finest, size_t num_levels) {
  std::vector<LatentSize> sizes{finest};
  while (sizes.size() < num_levels)
    sizes.push_back({(sizes.back().width + 1) / 2, (sizes.back().height + 1) / 2});
  return sizes;
}

}  // namespace patina::diffusion
