// Density of the lobes that incident directions are drawn from, for all directions of a point at once.
#pragma once

#include <cstddef>
#include <vector>

#include "patina/base/math.h"

namespace patina::inverse {

/// Unit vectors in world space, an array a coordinate.
struct DirectionArrays {
  std::vector<float> x, y, z;

  void resize(size_t count) { x.resize(count), y.resize(count), z.resize(count); }
  size_t size() const { return x.size(); }
  vec3 operator[](size_t i) const { return {x[i], y[i], z[i]}; }
  void set(size_t i, const vec3& direction) { x[i] = direction.x, y[i] = direction.y, z[i] = direction.z; }
};

/// How many directions were drawn about the normal `n` from a cosine lobe and from two lobes of visible GGX
/// normals, for a viewer in direction `wo`; both in world space.
struct LobeMixture {
  vec3 n, wo;
  float num_cosine = 0, num_narrow = 0, num_wide = 0;
  float alpha_narrow = 1, alpha_wide = 1;
};

/// density[i] = Σ_lobes number · pdf(directions[i]), 1/sr; zero below the horizon of n. The pdf of a GGX lobe
/// is D_wo(h) / (4 wo·h) [Heitz2018, Sec. 3].
void lobe_densities(const LobeMixture& mixture, const DirectionArrays& directions,
                    std::vector<float>& density);

}  // namespace patina::inverse
