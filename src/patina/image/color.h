// Colour spaces and tone mapping. Inside patina colour is linear Rec. 709; sRGB only at files and at the
// diffusion model.
#pragma once

#include "patina/image/image.h"

namespace patina {

/// The sRGB transfer function and its inverse [IEC 61966-2-1]; values outside [0,1] follow the same branches,
/// odd-symmetric.
float srgb_from_linear(float linear);
float linear_from_srgb(float srgb);
Image srgb_from_linear(const Image& linear);
Image linear_from_srgb(const Image& srgb);

/// Reinhard's L/(1+L) per channel [Reinhard2002, Eq. 3]: never clips, so its gradient is never zero. L >= 0
/// in, [0,1) out.
inline float reinhard(float radiance) {
  return radiance / (1.0f + radiance);
}
/// Its derivative d reinhard / d radiance.
inline float d_reinhard(float radiance) {
  return 1.0f / ((1.0f + radiance) * (1.0f + radiance));
}

/// The display image of an HDR render: srgb(reinhard(2^exposure_ev · radiance)); [H,W,3] linear in, sRGB
/// [0,1) out.
Image tone_map(const Image& radiance, float exposure_ev);

}  // namespace patina
