// The inner loops of Winograd's convolution. Private to winograd.cpp and its kernels, which see plain
// pointers alone.
//
// A tile is 2 × 2 pixels of the output and the 4 × 4 of the input around them, [16 frequencies] once
// transformed. Bf16 numbers of neighbouring input channels lie in pairs, as VDPBF16PS takes them.
#pragma once

#include <cstdint>

#include "patina/nn/pointwise.h"

namespace patina::nn::winograd {

inline constexpr int kFrequencies = 16;
inline constexpr int kPanel = 64;  // output channels that are summed at once, in four registers

/// Tiles [first, first + count) of one image, row by row.
struct Tiles {
  int64_t first, count;
  int64_t height, width;  // of the image, pixels
};

/// x [height, width, channels] -> v [16, count, channels], in pairs.
void transform_input(const Bf16* x, const Tiles& tiles, int64_t channels, uint32_t* v);

/// m [16, count, kPanel] = Σ over pairs of v [16, count, pairs] · u [16, pairs, kPanel], of the first
/// `out` columns, a multiple of 16.
void multiply(const uint32_t* v, const uint32_t* u, int64_t count, int64_t pairs, int64_t out, float* m);

/// The panel's pixels: m -> y [height, width, channels] from channel `first` on, `bias` [out] added.
void transform_output(const float* m, const Tiles& tiles, const float* bias, int64_t out, int64_t first,
                      int64_t channels, Bf16* y);

}  // namespace patina::nn::winograd
