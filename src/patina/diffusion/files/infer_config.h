// The sizes of networks told from the shapes of their tensors, for files that come without config.json. What
// shapes do not tell is a constant of Stable Diffusion 1.x and 2.x: 32 groups, 8 heads (1.x) or 64 channels a
// head (2.x and text encoders), epsilons and the VAE's scale. No Torch here.
#pragma once

#include "patina/diffusion/files/config.h"
#include "patina/diffusion/files/tensor_table.h"

namespace patina::diffusion {

/// Each throws Error{kFormat, kUnsupported} that names the tensor without which, or with which, the network
/// is none of Stable Diffusion 1.x or 2.x.
UNetConfig infer_unet_config(const TensorTable& table);
ControlNetConfig infer_controlnet_config(const TensorTable& table);
VaeConfig infer_vae_config(const TensorTable& table);
TextEncoderConfig infer_text_encoder_config(const TensorTable& table);

enum class Family { kSd1, kSd2 };
/// SD 2.x projects by linear layers where 1.x has 1×1 convolutions; every fine-tune keeps that.
Family family_of(const UNetConfig& config);
/// "Stable Diffusion 1.x".
const char* name_of(Family family);

}  // namespace patina::diffusion
