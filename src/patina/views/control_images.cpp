// The pictures that condition the ControlNets: tile (the tone-mapped view) and normal (camera-space normals
// in the colours of ControlNet v1.1 normalbae).
#include "patina/base/check.h"
#include "patina/image/color.h"
#include "patina/views/view_set.h"

namespace patina::views {

// The object's own colour is tone-mapped first (radiance divided by coverage), then laid over the backdrop in
// linear display light. Tone-mapping the premultiplied radiance instead would darken edges, blending sRGB
// codes would too.
Image tile_control(const View& view, float exposure_ev) {
  const Image& radiance = view.radiance;
  PATINA_CHECK_EQ(radiance.num_pixels(), view.coverage.num_pixels());
  const float scale = std::exp2(exposure_ev);
  const float backdrop = linear_from_srgb(kBackdropSrgb);
  Image out(radiance.width, radiance.height, 3);
  for (size_t pixel = 0; pixel < radiance.num_pixels(); ++pixel) {
    const float coverage = glm::clamp(view.coverage.pixels[pixel], 0.0f, 1.0f);
    for (size_t channel = 0; channel < 3; ++channel) {
      float display = (1.0f - coverage) * backdrop;
      if (coverage > 0.0f)
        display +=
            coverage * reinhard(scale * std::max(radiance.pixels[3 * pixel + channel], 0.0f) / coverage);
      out.pixels[3 * pixel + channel] = srgb_from_linear(display);
    }
  }
  return out;
}

Image normal_control(const View& view) {
  const GBuffer& gbuffer = view.gbuffer;
  const mat3 camera_from_world = glm::transpose(mat3(view.camera.world_from_camera));  // a rotation's inverse
  Image out(gbuffer.width, gbuffer.height, 3);
  for (size_t pixel = 0; pixel < out.num_pixels(); ++pixel) {
    if (gbuffer.primitive[pixel] < 0) continue;
    const vec3 n_camera = camera_from_world * gbuffer.n_shading_world[pixel];
    out.pixels[3 * pixel + 0] = glm::clamp(0.5f - 0.5f * n_camera.x, 0.0f, 1.0f);
    out.pixels[3 * pixel + 1] = glm::clamp(0.5f + 0.5f * n_camera.y, 0.0f, 1.0f);
    out.pixels[3 * pixel + 2] = glm::clamp(0.5f + 0.5f * n_camera.z, 0.0f, 1.0f);
  }
  return out;
}

}  // namespace patina::views
