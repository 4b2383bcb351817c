// How much a picture changes from pixel to pixel: the energy of its finest octaves, by which grain is judged.
#pragma once

#include <ATen/core/Tensor.h>

namespace patina::mini_data {

/// Variance within windows of 2 × 2 pixels, the energy of the finest octave of a Haar transform at every
/// shift, and of 4 × 4, that of the two finest. pictures [B,C,H,W] f32 -> each [B,1,H-3,W-3], mean over
/// channels, at the windows of 4 × 4.
struct FineEnergy {
  at::Tensor finest, both;
};
FineEnergy fine_energy(const at::Tensor& pictures);

/// Where windows of 4 × 4 lie within the object, two pixels from its border at least: coverage [B,1,H,W] in
/// [0,1] -> [B,1,H-3,W-3] of 0 and 1.
at::Tensor windows_inside(const at::Tensor& coverage);

}  // namespace patina::mini_data
