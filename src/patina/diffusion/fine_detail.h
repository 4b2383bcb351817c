// What the VAE loses of the renders, for the edited views (docs/decisions/0010). Seen only by the sources
// that see Torch.
#pragma once

#include "patina/diffusion/networks/vae.h"

namespace patina::diffusion {

/// What is to be added to an edited view: lettering, thin lines and the edges of silhouettes that the VAE
/// loses of the render. Light and dark come back whole; colour the less the farther the edit moved the
/// colours around, since the edges of a red line would be coloured fringes on copper. All [1,3,H,W] f32 sRGB
/// in [0,1].
at::Tensor fine_detail(const Vae& vae, const at::Tensor& render, const at::Tensor& edited);

}  // namespace patina::diffusion
