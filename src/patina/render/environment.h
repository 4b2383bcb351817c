// Light from infinitely far away: an equirectangular HDR map with importance sampling, or a constant.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "patina/image/image.h"

namespace patina::render {

/// Direction ↔ map: the map's centre column looks along +X, its right half toward +Z, its top row at +Y, as
/// Blender shows it around an imported glTF asset and as glTF viewers built on three.js do.
class Environment {
 public:
  /// radiance [H,W,3] linear, non-negative, finite, W/m²/sr per unit; builds the sampling tables. Throws
  /// Error{kFormat}.
  explicit Environment(Image radiance);

  /// What arrives from a unit direction, bilinear and wrapping in azimuth, and the density, per steradian,
  /// with which `sample` would have chosen it.
  struct Arrival {
    vec3 radiance;
    float pdf;
  };
  Arrival arrival(const vec3& direction) const;
  vec3 radiance(const vec3& direction) const { return arrival(direction).radiance; }
  float pdf(const vec3& direction) const { return arrival(direction).pdf; }
  struct Sample {
    vec3 direction;
    vec3 radiance;
    float pdf;  // per steradian, > 0
  };
  /// Texels are chosen in proportion to the light that the bilinear look-up gives over them, directions
  /// uniformly over the texel's solid angle; so the density is positive wherever the radiance is, and exact
  /// at the poles.
  Sample sample(const vec2& u) const;
  const Image& map() const { return radiance_; }
  /// Mean over the sphere of the mean of the three channels, W/m²/sr.
  float mean_radiance() const { return mean_radiance_; }

 private:
  Image radiance_;
  std::vector<vec4>
      texels_;  // [H, W] radiance and density: one line of the cache holds all that a look-up needs
  std::vector<float> marginal_cdf_;         // [H+1] over rows
  std::vector<float> conditional_cdf_;      // [H, W+1] over the columns of each row
  std::vector<int32_t> marginal_guide_;     // [H] where a search in the table may begin
  std::vector<int32_t> conditional_guide_;  // [H, W]
  std::vector<double> row_cosine_;          // [H+1] cosine of the polar angle at the row boundaries, 1 to -1
  float mean_radiance_ = 0;
};

/// A map of `light`, radiance by unit direction: for lights that are made by formula.
Environment environment_of(const std::function<vec3(const vec3&)>& light);
/// The built-in studio: soft key, fill and rim boxes over a grey dome, lit for materials; made by formula, so
/// no file is needed.
Environment studio_environment();
Environment constant_environment(const vec3& radiance);
Environment read_environment(const std::filesystem::path& path);

}  // namespace patina::render
