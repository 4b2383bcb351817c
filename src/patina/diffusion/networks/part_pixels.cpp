#include "patina/diffusion/networks/part_pixels.h"

#include <ATen/ATen.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/diffusion/files/unet_blocks.h"

namespace patina::diffusion {

PartLevels::PartLevels(const at::Tensor& shares, size_t num_levels) {
  PATINA_CHECK_EQ(shares.dim(), 3);
  for (const LatentSize& size : level_sizes({shares.size(2), shares.size(1)}, num_levels)) {
    const at::Tensor pooled = at::adaptive_avg_pool2d(shares, {size.height, size.width}).flatten(1);
    Level level{size.height, size.width, {}};
    for (int64_t part = 0; part < shares.size(0); ++part) {
      const at::Tensor of_part = pooled[part], index = at::nonzero(of_part).squeeze(1);
      level.parts.push_back({index, of_part.index_select(0, index).unsqueeze(1)});
    }
    levels_.push_back(std::move(level));
  }
}

const std::vector<PartPixels>& PartLevels::at(int64_t height, int64_t width) const {
  for (const Level& level : levels_)
    if (level.height == height && level.width == width) return level.parts;
  throw Error(ErrorCode::kUsage, "part views", "are no views of these latents");
}

}  // namespace patina::diffusion
