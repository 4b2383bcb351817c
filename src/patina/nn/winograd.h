// 3×3 convolutions of bf16 images by Winograd's F(2×2, 3×3) [Lavin2016]: 16 products where the plain sum
// takes 36, for processors with AVX-512 BF16. No Torch here.
#pragma once

#include <cstdint>
#include <memory>

#include "patina/nn/pointwise.h"

namespace patina::nn {

/// Whether this processor runs it and gains by it. Where there is AMX, oneDNN's plain sums are faster.
bool winograd_pays();

/// The weights of one layer, transformed: 16/9 of their size before.
class Winograd {
 public:
  /// `weight` [out, in, 3, 3], `bias` [out]. `in` is a multiple of 32, `out` of 16.
  Winograd(const Bf16* weight, const Bf16* bias, int64_t in, int64_t out);

  static bool takes(int64_t in, int64_t out) { return in % 32 == 0 && out % 16 == 0; }
  int64_t in() const { return in_; }
  int64_t out() const { return out_; }
  int64_t num_bytes() const;

  /// Cross-correlation with zeros around: x [batch, height, width, in] -> y [batch, height, width, out].
  /// Transformed tiles are rounded to bf16, sums are f32: about twice the error of plain sums.
  void operator()(const Bf16* x, Bf16* y, int64_t batch, int64_t height, int64_t width) const;

 private:
  int64_t in_, out_;
  std::unique_ptr<uint32_t[]> pairs_;  // as winograd_kernel.h lays them out
  std::unique_ptr<float[]> bias_;
};

}  // namespace patina::nn
