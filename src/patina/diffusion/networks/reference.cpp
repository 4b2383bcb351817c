#include "patina/diffusion/networks/reference.h"

#include <string_view>

#include <ATen/ATen.h>

#include "patina/base/error.h"
#include "patina/diffusion/files/unet_blocks.h"

namespace patina::diffusion {

nn::Recorder record_reference(ReferenceTokens& tokens) {
  return nn::Recorder([&tokens](const std::string& path, const at::Tensor& output) {
    constexpr std::string_view kEnd = ".norm1";
    if (path.find(".transformer_blocks.") != std::string::npos && path.ends_with(kEnd)) tokens[path] = output;
  });
}

ReferenceWeights::ReferenceWeights(const at::Tensor& weights, size_t num_levels) {
  for (const LatentSize& size : level_sizes({weights.size(1), weights.size(0)}, num_levels)) {
    const at::Tensor pooled = at::adaptive_avg_pool2d(weights.unsqueeze(0), {size.height, size.width});
    levels_.push_back({size.height, size.width, at::log(pooled).view({1, 1, -1})});
  }
}

const at::Tensor& ReferenceWeights::log_at(int64_t height, int64_t width) const {
  for (const Level& level : levels_)
    if (level.height == height && level.width == width) return level.log_weights;
  throw Error(ErrorCode::kUsage, "exemplar", "has weights for latents of another size");
}

}  // namespace patina::diffusion
