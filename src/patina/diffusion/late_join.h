// Differential diffusion [Levin2023]: every latent pixel has a strength of its own. It joins the denoising at
// the step that its strength gives, and is the noised start image until then. Torch-free: latents are spans
// of f32.
#pragma once

#include <span>
#include <vector>

#include "patina/diffusion/schedulers/schedulers.h"
#include "patina/image/image.h"

namespace patina::diffusion {

/// Of a grid of latents [C,H,W].
struct LateJoin {
  std::vector<int> first_call;   // [H·W] the plan's call from which on the pixel is denoised; num_calls():
                                 // it never is
  std::vector<float> x0, noise;  // [C,H,W] latents of the start images, and the noise that they are under
};

/// [H·W] the strength of every latent pixel: the largest of the scale × scale pixels [0,1] under it, so that
/// a thin line is edited at its full strength. Pixels below 0 show nothing that has a strength and do not
/// count; where all do so it is 1. `views`: grid² images [h,w,1], row by row.
std::vector<float> latent_strengths(std::span<const Image> views, int grid, int scale);

/// LateJoin::first_call for `strengths` in [0,1], each a share of `strength` (as start_index takes it).
std::vector<int> first_calls(const SchedulePlan& plan, double strength, std::span<const float> strengths);

/// Before call `index`: latents [C,H,W] of pixels that have not joined, or join now, become the start image
/// under that call's noise.
void hold_latents(const LateJoin& late, const SchedulePlan& plan, int index, std::span<float> latents);

/// After call `index`: the network's output [C,H,W] for pixels that have not joined becomes what leads to the
/// start image, so that solvers that remember earlier outputs remember the right ones.
void hold_output(const LateJoin& late, const SchedulePlan& plan, int index, std::span<float> output);

/// After the last call: pixels that never joined become the start image exactly.
void restore_start(const LateJoin& late, const SchedulePlan& plan, std::span<float> latents);

}  // namespace patina::diffusion
