// Trains the text encoder, the U-Net and both ControlNets together on latents of aged objects.
#pragma once

#include <filesystem>

#include <c10/core/Device.h>

#include "run.h"

namespace patina::train_mini {

struct DenoiserTraining {
  RunOptions run;
  int64_t crops = 48;                                 // of half a view's side, a step of these
  int64_t views = 12;                                 // whole views, a step of these
  int64_t grids = 3;                                  // of 2 × 2 views of one object, a step of these
  double share_of_crops = 0.5, share_of_grids = 0.2;  // of the steps; the rest are of whole views
  bool from_model = false;  // begin with MODEL's weights where WORK has no checkpoint
  c10::Device device = c10::kCPU;
};

/// WORK holds samples and their latents (see encode_latents) and gets <component>.checkpoint and
/// denoiser.log. MODEL holds config.json of each component, the tokenizer, and the VAE; the weights are
/// written beside the configurations. Goes on where an earlier call stopped.
void train_denoiser(const std::filesystem::path& work, const std::filesystem::path& model,
                    const DenoiserTraining& options);

}  // namespace patina::train_mini
