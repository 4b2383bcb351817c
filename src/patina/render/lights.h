// Next-event estimation: chooses a light, and a direction toward it, for a point of the scene.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/render/environment.h"

namespace patina::render {

/// Light that would arrive at a point along `direction` if nothing stood between.
struct LightSample {
  vec3 direction{0.0f};  // unit, toward the light
  vec3 p_light{0.0f};    // where it comes from; unused if at_infinity
  bool at_infinity = false;
  vec3 radiance{0.0f};  // W/m²/sr; for punctual lights irradiance on a plane that faces the light, W/m²
  float pdf = 0;        // per steradian; for punctual lights the probability that this one was chosen
};

/// Everything in a scene that emits. Environment and emissive triangles are sampled as one
/// (`sample_extended`), so that a path that meets them by chance can be weighed against it; punctual lights
/// cannot be met and are sampled apart.
class Lights {
 public:
  Lights() = default;
  /// The arguments must live as long as the object. `primitives` and `material_of_primitive` run in parallel;
  /// `scene_radius` in metres weighs the environment against the emitters.
  Lights(const Environment& environment, std::span<const asset::Primitive* const> primitives,
         std::span<const int> material_of_primitive, std::span<const asset::MaterialMaps> materials,
         std::span<const asset::Light> punctual, float scene_radius);

  /// One direction toward the environment or an emissive triangle (chosen in proportion to its power);
  /// nullopt if there is no such light or the triangle is seen edge-on. `u_light` chooses the light.
  std::optional<LightSample> sample_extended(const vec3& p, float u_light, const vec2& u) const;
  /// What the environment sends from `direction`, and the density with which sample_extended would have
  /// chosen that direction toward it, 1/sr.
  Environment::Arrival arrival_from_environment(const vec3& direction) const;
  float pdf_environment(const vec3& direction) const { return arrival_from_environment(direction).pdf; }
  /// The same for the point at distance `t` along `direction` on a triangle whose unit geometric normal is
  /// `n`.
  float pdf_triangle(uint32_t primitive, uint32_t triangle, const vec3& direction, float t,
                     const vec3& n) const;

  /// One punctual light, chosen in proportion to what it would give a surface at `p`; nullopt if none reaches
  /// it.
  std::optional<LightSample> sample_punctual(const vec3& p, float u_light) const;

  bool has_extended() const { return environment_probability_ > 0 || !emitters_.empty(); }
  bool has_punctual() const { return !punctual_.empty(); }
  bool has_emitters() const { return !emitters_.empty(); }

 private:
  struct Emitter {
    uint32_t primitive, triangle;
    float area;  // m²
  };

  const Environment* environment_ = nullptr;
  std::span<const asset::Primitive* const> primitives_;
  std::span<const int> material_of_primitive_;
  std::span<const asset::MaterialMaps> materials_;
  std::span<const asset::Light> punctual_;
  float environment_probability_ = 0;
  std::vector<Emitter> emitters_;
  std::vector<float> emitter_cdf_;  // [emitters + 1]
  std::vector<std::vector<float>>
      density_;  // per primitive, per triangle: probability / area, 1/m²; empty: none
};

/// Irradiance of a punctual light on a plane at `p` that faces it, and the unit direction toward it
/// [KHR_lights_punctual].
struct PunctualArrival {
  vec3 direction{0.0f};
  vec3 irradiance{0.0f};  // W/m²
};
PunctualArrival punctual_arrival(const asset::Light& light, const vec3& p);

}  // namespace patina::render
