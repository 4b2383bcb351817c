// One look at the light cache: loss of the current textures and its gradient with respect to every fitted
// map.
#pragma once

#include <span>
#include <vector>

#include "patina/inverse/fit_state.h"
#include "patina/inverse/light_cache.h"

namespace patina::inverse {

struct Evaluation {
  float loss = 0;  // weighted mean over pixels
  std::vector<Image>
      d_delta;  // per fitted map, shape of field.delta; derivative of the weighted *sum* over pixels
  std::vector<vec3> radiance;  // of every pixel, [3] linear
};

/// `other`: radiance of the same pixels from other caches, against whose error this cache's is multiplied
/// (relative_l2). Sums are taken in a fixed order: the result does not depend on the number of threads.
Evaluation evaluate(const LightCache& cache, std::span<const vec3> other, std::span<const FittedMap> fitted,
                    render::BsdfModel model, float gain);

/// Radiance of every cache pixel, [3] linear.
std::vector<vec3> shade_pixels(const LightCache& cache, std::span<const FittedMap> fitted,
                               render::BsdfModel model);

}  // namespace patina::inverse
