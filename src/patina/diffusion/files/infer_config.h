// The sizes of networks told from the shapes of their tensors, for files that come without config.json. What
// shapes do not tell is a constant of all families (32 groups, epsilons, the VAE's scale) or stands in the
// table of families (families.h). No Torch here.
#pragma once

#include "patina/diffusion/files/config.h"
#include "patina/diffusion/files/tensor_table.h"

namespace patina::diffusion {

/// Each throws Error{kFormat, kUnsupported} that names the tensor without which, or with which, the network
/// is of no family that patina runs.
UNetConfig infer_unet_config(const TensorTable& table);
ControlNetConfig infer_controlnet_config(const TensorTable& table);
VaeConfig infer_vae_config(const TensorTable& table);
TextEncoderConfig infer_text_encoder_config(const TensorTable& table);

}  // namespace patina::diffusion
