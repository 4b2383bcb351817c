// The order of a U-Net's blocks, written down once: which residual block takes how many channels, where
// transformers stand, what is kept for the way up. The networks, their names in files and the list of
// attention layers all follow it. No Torch here.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "patina/diffusion/files/config.h"

namespace patina::diffusion {

/// A residual block and the transformer behind it, by their paths in diffusers' weight files.
struct UNetLayer {
  std::string resnet;                      // "down_blocks.0.resnets.1"
  int64_t in_channels = 0;                 // without what was kept on the way down
  int64_t skip_channels = 0;               // of the kept output that is taken beside the input; 0: none
  int64_t out_channels = 0;                // those of the level
  std::optional<std::string> transformer;  // "down_blocks.0.attentions.1"
};

struct UNetBlock {
  std::string name;                      // "down_blocks.0", "mid_block", "up_blocks.3"
  size_t level = 0;                      // 0 is the finest
  std::vector<UNetLayer> layers;         // in the order in which they run
  std::optional<std::string> resampler;  // behind the layers: "down_blocks.0.downsamplers.0"
};

/// From the finest level to the coarsest: of U-Nets and ControlNets. Each layer's output and each resampler's
/// is kept for the way up, and so is the output of conv_in before them.
std::vector<UNetBlock> down_blocks(std::span<const LevelConfig> levels);
/// Two residual blocks at the coarsest level with a transformer between them.
UNetBlock mid_block(std::span<const LevelConfig> levels);
/// From the coarsest level back. Each layer takes one kept output, the last one first.
std::vector<UNetBlock> up_blocks(std::span<const LevelConfig> levels);

/// The name of a level's block on either way; up_blocks count from the coarsest level.
std::string down_block_name(size_t level);
std::string up_block_name(size_t level, size_t num_levels);

/// Channels of each kept output, in the order in which they are made.
std::vector<int64_t> skip_channels(std::span<const LevelConfig> levels);

/// Latent pixels of one level.
struct LatentSize {
  int64_t width = 0, height = 0;
  bool operator==(const LatentSize&) const = default;
};
/// Of every level, finest first: each is half of the last, rounded up as strided convolutions do.
std::vector<LatentSize> level_sizes(LatentSize finest, size_t num_levels);

}  // namespace patina::diffusion
