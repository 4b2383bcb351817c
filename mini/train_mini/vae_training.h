// Trains the autoencoder on pictures of clean and aged objects.
#pragma once

#include <filesystem>

#include <c10/core/Device.h>

#include "run.h"

namespace patina::train_mini {

struct VaeTraining {
  RunOptions run;
  int64_t batch = 8;  // crops of `side` a step
  int64_t side = 128;
  bool decoder_only = false;  // keeps the latents that a denoiser was trained on
  c10::Device device = c10::kCPU;
};

/// WORK holds samples (training/, held_out/) and gets vae.checkpoint and vae.log; MODEL/vae/config.json says
/// the sizes, and its weights are written beside it. Goes on where an earlier call stopped.
void train_vae(const std::filesystem::path& work, const std::filesystem::path& model,
               const VaeTraining& options);

/// Latents of the aged pictures of WORK/training and WORK/held_out, as they are and mirrored, to
/// FOLDER/latents.f16 [samples, 2, C, h, w]; and the scaling factor that brings them to unit variance to
/// MODEL/vae/config.json.
void encode_latents(const std::filesystem::path& work, const std::filesystem::path& model,
                    c10::Device device);

}  // namespace patina::train_mini
