// Which latent pixels show which part of the picture, for parts that have words of their own.
#pragma once

#include <cstdint>
#include <vector>

#include <ATen/core/Tensor.h>

namespace patina::diffusion {

/// One part at one resolution.
struct PartPixels {
  at::Tensor index;  // [n] int64, ascending: the latent pixels, row by row, that show some of the part
  at::Tensor share;  // [n,1] f32 in (0,1]: how much of each
};

/// All parts at every resolution of a U-Net.
class PartLevels {
 public:
  /// `shares` [parts,H,W] f32 at the finest of `num_levels` resolutions; those of a pixel add up to 1.
  PartLevels(const at::Tensor& shares, size_t num_levels);

  /// One a part. Throws Error{kUsage} unless height × width is one of the resolutions.
  const std::vector<PartPixels>& at(int64_t height, int64_t width) const;

 private:
  struct Level {
    int64_t height, width;
    std::vector<PartPixels> parts;
  };
  std::vector<Level> levels_;
};

}  // namespace patina::diffusion
