// Finishes the autoencoder's decoder against a discriminator, so that grain is drawn, not averaged away.
#pragma once

#include <filesystem>

#include <c10/core/Device.h>

#include "run.h"

namespace patina::train_mini {

struct AdversarialTraining {
  RunOptions run;
  int64_t batch = 4;  // crops of `side` a step, each decoded from the encoder's and the denoiser's latents
  int64_t side = 128;
  c10::Device device = c10::kCPU;
};

/// Trains the decoder of MODEL/vae, beginning with its weights; encoder and latents stay, and with them
/// U-Net and ControlNets. WORK holds samples and decoder.f16 (make_decoder_data) and gets decoder.checkpoint,
/// discriminator.checkpoint and adversarial.log. The weights are written to MODEL/vae. Goes on where an
/// earlier call stopped.
void train_adversarially(const std::filesystem::path& work, const std::filesystem::path& model,
                         const AdversarialTraining& options);

}  // namespace patina::train_mini
