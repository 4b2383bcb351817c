// Light that arrives at a pixel's surface, summed up in 64 bins of directions. Bins are cells of the half
// vector between viewer and light around the surface's normal: narrow about the mirror direction, where a
// glossy lobe is, and wide elsewhere. Any number of traced directions goes into them, so that noise falls
// with every trace while shading costs the same.
#pragma once

#include <array>
#include <cstddef>

#include "patina/base/math.h"
#include "patina/inverse/incident_light.h"

namespace patina::inverse {

inline constexpr size_t kNumBins = 64;

/// The surface on which the light falls. Unit vectors in world space.
struct BinFrame {
  vec3 n, wo;        // shading normal; toward the viewer
  vec3 x, y;         // span the plane across n
  float alpha2 = 1;  // of the GGX lobe under which a bin's sum is exact
};
BinFrame bin_frame(const vec3& n, const vec3& wo, float alpha2);

/// The bin of unit direction `wi`; any direction has one.
size_t bin_of(const BinFrame& frame, const vec3& wi);

/// What falls on one surface.
class LightBins {
 public:
  void add(const BinFrame& frame, const IncidentLight& light);

  /// The one direction that stands for all in `bin`, with the radiance that makes it light `frame`'s surface
  /// as they did together: the same irradiance, and the same mean of GGX's D. No light: radiance zero.
  IncidentLight mean(size_t bin, const BinFrame& frame) const;

 private:
  struct Bin {
    vec3 irradiance{0.0f};  // Σ n·wi · weighted radiance
    float density = 0;      // Σ luminance of the irradiance / (tan²θ_h + α²)²
    vec2 azimuth{0.0f};     // Σ luminance of the irradiance · direction of the half vector across n
  };
  std::array<Bin, kNumBins> bins_{};
};

}  // namespace patina::inverse
