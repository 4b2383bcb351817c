// What a U-Net was trained to tell, asked of the U-Net itself.
#pragma once

#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/schedulers/schedulers.h"

namespace patina::diffusion {

/// At the last timestep a sample is all but pure noise, √(1 - ᾱ) ≈ 1. A network that predicts the noise gives
/// back its input; one that predicts v = √ᾱ ε - √(1 - ᾱ) x0 [Salimans2022] gives the image, which has nothing
/// to do with it. So the correlation of output and input is near 1 or near 0. One evaluation at 16² latents
/// with a text of zeros.
Prediction ask_prediction(const UNet& unet, const SchedulerConfig& scheduler);

}  // namespace patina::diffusion
