// What a latent pixel covers: how much of it shows enhanced surface, and how much surface that is; and
// whether another view sees the same.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "patina/render/scene.h"
#include "patina/views/visibility.h"

namespace patina::correspond {

/// Surface area in m² that one square pixel sees through `ray` at `front`: t² dω / cos θ, with the solid
/// angle of an off-axis pixel. Grazing hits count at most a thousand times their projected area.
float area_per_pixel(const render::Camera& camera, const render::Ray& ray, const views::FrontHit& front);

/// views::seen_at for a point of the asset's `primitive`, which has one front or, with a double-sided
/// material, two: both sides have the same texture, so a view of either is a view of the same surface.
std::optional<vec2> seen_from(const render::Scene& scene, const render::Camera& camera, uint32_t primitive,
                              const vec3& p_world, vec3 n_world);

/// Latent pixels of one view, [height, width] row by row, by 4 × 4 rays each.
struct Footprints {
  int width = 0, height = 0;
  std::vector<float> coverage;  // share of the latent pixel that shows the front of enhanced surface, [0,1]
  std::vector<float> area;      // m² of surface in it
};
Footprints trace_footprints(const render::Scene& scene, const render::Camera& camera, int latent_scale);

/// [height · width] of the whole grid of views: 1 where a latent pixel shows some enhanced surface. Noise
/// there is what noise_statistics should look at; elsewhere it is independent by construction.
std::vector<uint8_t> surface_mask(const render::Scene& scene, std::span<const render::Camera> cameras,
                                  int latent_scale);

}  // namespace patina::correspond
