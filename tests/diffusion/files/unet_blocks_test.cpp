// The order of a U-Net's blocks, against the published layout of Stable Diffusion, and the table of families.
#include "patina/diffusion/files/unet_blocks.h"

#include <gtest/gtest.h>

#include "make_checkpoint/configs.h"
#include "patina/diffusion/files/families.h"

namespace patina::diffusion {
namespace {

std::vector<LevelConfig> sd15_levels() {
  return make_checkpoint::configs_of(Family::kSd1, make_checkpoint::Size::kFull).unet.levels;
}

TEST(UNetBlocks, keeps_the_twelve_outputs_that_controlnets_of_stable_diffusion_add_to) {
  EXPECT_EQ(skip_channels(sd15_levels()),
            (std::vector<int64_t>{320, 320, 320, 320, 640, 640, 640, 1280, 1280, 1280, 1280, 1280}));
}

TEST(UNetBlocks, every_kept_output_is_taken_once_and_last_first) {
  const std::vector<LevelConfig> levels = sd15_levels();
  std::vector<int64_t> taken;
  for (const UNetBlock& block : up_blocks(levels))
    for (const UNetLayer& layer : block.layers) taken.push_back(layer.skip_channels);
  EXPECT_EQ(std::vector<int64_t>(taken.rbegin(), taken.rend()), skip_channels(levels));
}

TEST(UNetBlocks, layers_follow_each_other_without_a_gap) {
  const std::vector<LevelConfig> levels = sd15_levels();
  std::vector<UNetBlock> blocks = down_blocks(levels);
  blocks.push_back(mid_block(levels));
  for (const UNetBlock& block : up_blocks(levels)) blocks.push_back(block);
  int64_t channels = levels.front().channels;
  for (const UNetBlock& block : blocks)
    for (const UNetLayer& layer : block.layers) {
      EXPECT_EQ(layer.in_channels, channels) << layer.resnet;
      channels = layer.out_channels;
    }
  EXPECT_EQ(channels, levels.front().channels);
}

TEST(UNetBlocks, names_are_those_of_diffusers) {
  const std::vector<LevelConfig> levels = sd15_levels();
  const std::vector<UNetBlock> down = down_blocks(levels), up = up_blocks(levels);
  ASSERT_EQ(down.size(), 4u);
  EXPECT_EQ(down[1].layers[1].resnet, "down_blocks.1.resnets.1");
  EXPECT_EQ(down[1].layers[1].transformer, "down_blocks.1.attentions.1");
  EXPECT_EQ(down[1].resampler, "down_blocks.1.downsamplers.0");
  EXPECT_EQ(down[3].layers[0].transformer, std::nullopt);
  EXPECT_EQ(down[3].resampler, std::nullopt);
  EXPECT_EQ(mid_block(levels).layers[0].transformer, "mid_block.attentions.0");
  EXPECT_EQ(up[0].level, 3u);
  EXPECT_EQ(up[0].resampler, "up_blocks.0.upsamplers.0");
  EXPECT_EQ(up[3].layers[2].transformer, "up_blocks.3.attentions.2");
  EXPECT_EQ(up[3].resampler, std::nullopt);
  for (const UNetBlock& block : up) EXPECT_EQ(block.name, up_block_name(block.level, levels.size()));
}

TEST(UNetBlocks, levels_halve_and_round_up) {
  EXPECT_EQ(level_sizes({10, 13}, 4), (std::vector<LatentSize>{{10, 13}, {5, 7}, {3, 4}, {2, 2}}));
}

TEST(Families, every_row_stands_at_its_familys_place) {
  for (size_t i = 0; i < kFamilies.size(); ++i) {
    EXPECT_EQ(kFamilies[i].family, static_cast<Family>(i));
    EXPECT_NE(kFamilies[i].num_heads > 0, kFamilies[i].head_width > 0) << kFamilies[i].name;
  }
}

TEST(Families, no_two_share_what_tells_them_apart) {
  for (const FamilyTraits& a : kFamilies)
    for (const FamilyTraits& b : kFamilies) {
      if (a.family == b.family) continue;
      EXPECT_NE(a.linear_projection, b.linear_projection);
      EXPECT_NE(a.text_width, b.text_width);
    }
}

TEST(Families, a_text_encoder_is_told_by_its_names_first_and_by_its_width_then) {
  EXPECT_EQ(family_of_text_encoder(Naming::kDiffusers, 768), Family::kSd1);
  EXPECT_EQ(family_of_text_encoder(Naming::kDiffusers, 1024), Family::kSd2);
  EXPECT_EQ(family_of_text_encoder(Naming::kOpenClip, 128), Family::kSd2);
  EXPECT_EQ(family_of_text_encoder(Naming::kDiffusers, 64), Family::kSd1);
  EXPECT_EQ(family_of_text_width(640), std::nullopt);
}

}  // namespace
}  // namespace patina::diffusion
