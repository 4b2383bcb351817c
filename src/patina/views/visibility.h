// Whether a camera sees a point of the surface, and which surfaces count: the asset's own, from their front.
#pragma once

#include <optional>
#include <span>

#include "patina/render/scene.h"

namespace patina::views {

/// How much nearer to the eye than the point, as a share of its distance, a surface must lie to hide it. It
/// covers the rounding of single-precision positions (1e-7) and of Embree's hits at grazing angles.
inline constexpr float kVisibilityTolerance = 1e-4f;

/// A ray's first surface if the asset (not its context) owns it and shows its front; a double-sided material
/// has two fronts.
struct FrontHit {
  render::Hit hit;
  vec3 p_world;
  vec3 n_world;  // unit, geometric, toward the eye
  float cosine;  // between n_world and the direction to the eye, in (0,1]
};
std::optional<FrontHit> front_hit(const render::Scene& scene, const render::Ray& ray);

/// Pixel coordinates at which `camera` sees the point p with geometric normal n; nullopt where p lies behind
/// the eye, outside of the image, on a surface turned away, or behind something.
std::optional<vec2> seen_at(const render::Scene& scene, const render::Camera& camera, const vec3& p_world,
                            const vec3& n_world);

/// Which surface no view sees: shares of the asset's whole area, by the side to which it faces.
struct UnseenSurface {
  float down = 0, up = 0,
        sideways = 0;  // normals more than 45 degrees below or above the horizon, and others
  float all() const { return down + up + sideways; }
};
UnseenSurface unseen_surface(const render::Scene& scene, std::span<const render::Camera> cameras);

/// Why surface is not seen by any camera although nothing lies in front of it, as shares of the asset's area:
/// only its back shows, or it is transparent.
struct UnseenCauses {
  float turned_away = 0, transparent = 0;
};
UnseenCauses unseen_causes(const render::Scene& scene, std::span<const render::Camera> cameras);

/// True if nothing lies between the eye and p; neither facing nor the image's frame is asked for.
bool unoccluded(const render::Scene& scene, const vec3& eye, const vec3& p_world);

/// True if the surface at p, seen from the eye, is there: false where a mask or a blend makes it transparent.
bool opaque_at(const render::Scene& scene, const vec3& eye, const vec3& p_world);

}  // namespace patina::views
