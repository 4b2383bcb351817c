// Which latent pixels of two views show the same surface, and how much of it: found by rays through the
// pixels, whatever the noise is and however it was made.
#pragma once

#include <cstdint>
#include <vector>

#include "patina/render/scene.h"

namespace patina::correspond {

/// What an even grid of rays, samples_per_side² a latent pixel, meets in one view.
struct SurfaceSamples {
  struct Sample {
    vec3 p_world;
    vec3 n_world;  // unit, geometric, toward the eye
    float area;    // m² of surface that the ray stands for
    uint32_t primitive;
  };
  render::Camera camera;
  int width = 0, height = 0;       // latent pixels
  std::vector<Sample> samples{};   // latent pixel by latent pixel
  std::vector<int64_t> first{};    // [width · height + 1], into samples
  std::vector<double> area{};      // [width · height] m²
  std::vector<double> coverage{};  // [width · height] share of the latent pixel that shows enhanced surface
};
SurfaceSamples sample_surface(const render::Scene& scene, const render::Camera& camera, int latent_scale,
                              int samples_per_side);

/// A latent pixel of one view and the one of another with which it shares most surface.
struct SharedPatch {
  int32_t from = 0, to = 0;  // row-major, each in its own view
  double bound = 0;          // √(c₁ c₂) · overlap / √(A₁ A₂), c the coverages
};
/// One entry for each latent pixel of `from` of which `to` sees something, ascending. Both must have been
/// sampled in `scene` at one latent scale.
std::vector<SharedPatch> shared_patches(const render::Scene& scene, const SurfaceSamples& from,
                                        const SurfaceSamples& to);

}  // namespace patina::correspond
