#include "patch.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace patina::kettle {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

double outer_radius(const Patch& patch) {
  return 0.5 * patch.width;
}

// Metres from the island's corner.
dvec2 island_at(const Patch& patch, double s, double t) {
  if (patch.island == IslandKind::kStrip) return {s * patch.width, t * patch.height};
  const double radius = glm::mix(patch.inner_radius, outer_radius(patch), t);
  return outer_radius(patch) + radius * dvec2(std::cos(kTwoPi * s), std::sin(kTwoPi * s));
}

}  // namespace

dvec2 uv_at(const Patch& patch, double s, double t) {
  return patch.uv_corner + patch.uv_scale * island_at(patch, s, t);
}

Parameter parameter_at(const Patch& patch, const dvec2& uv) {
  const dvec2 p = (uv - patch.uv_corner) / patch.uv_scale;
  if (patch.island == IslandKind::kStrip)
    return {std::clamp(p.x / patch.width, 0.0, 1.0), std::clamp(p.y / patch.height, 0.0, 1.0)};
  const dvec2 d = p - outer_radius(patch);
  const double angle = std::atan2(d.y, d.x) / kTwoPi;
  const double t = (glm::length(d) - patch.inner_radius) / (outer_radius(patch) - patch.inner_radius);
  return {angle < 0 ? angle + 1 : angle, std::clamp(t, 0.0, 1.0)};
}

Frame frame_at(const Patch& patch, double s, double t) {
  // Central differences, one-sided at the ends of t, away from a disc's centre, where s has no direction.
  constexpr double kStep = 1e-3;
  const double t_inside =
      patch.inner_radius == 0 && patch.island == IslandKind::kDisc ? std::max(t, 4 * kStep) : t;
  const double t0 = std::max(t_inside - kStep, 0.0), t1 = std::min(t_inside + kStep, 1.0);
  const dvec3 dp_ds = patch.position(s + kStep, t_inside) - patch.position(s - kStep, t_inside);
  const dvec3 dp_dt = (patch.position(s, t1) - patch.position(s, t0)) * (2 * kStep / (t1 - t0));
  const dvec2 du_ds = island_at(patch, s + kStep, t_inside) - island_at(patch, s - kStep, t_inside);
  const dvec2 du_dt = (island_at(patch, s, t1) - island_at(patch, s, t0)) * (2 * kStep / (t1 - t0));
  const double determinant = du_ds.x * du_dt.y - du_dt.x * du_ds.y;
  const dvec3 dp_du = (dp_ds * du_dt.y - dp_dt * du_ds.y) / determinant;
  const dvec3 dp_dv = (dp_dt * du_ds.x - dp_ds * du_dt.x) / determinant;
  Frame frame;
  frame.position = patch.position(s, t);
  frame.normal = glm::normalize(glm::cross(dp_dv, dp_du));
  frame.along_u = glm::normalize(dp_du - glm::dot(dp_du, frame.normal) * frame.normal);
  return frame;
}

}  // namespace patina::kettle
