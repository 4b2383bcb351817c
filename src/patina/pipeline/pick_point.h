// A point of the surface that pictures of several views shall be compared at, and where each view shows it.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "patina/views/view_set.h"

namespace patina::pipeline {

/// A view shows a point well at this cosine between the surface and the direction to the eye (66°) or more.
inline constexpr float kGoodCosine = 0.4f;

struct PickedPoint {
  int view = 0;  // in which it was picked
  vec3 p_world{0.0f}, n_world{0.0f};
  int material = -1;  // into Scene::materials()
  /// Where each view shows it, in continuous pixels, and at which cosine; nullopt where it is hidden or
  /// turned away.
  struct Sight {
    vec2 pixel;
    float cosine;
  };
  std::vector<std::optional<Sight>> sights;

  int num_good_views() const;
};

/// How a user names a point; nothing at all: best_point.
struct PointOptions {
  std::optional<int> view = {};                   // counted from 0
  std::optional<std::pair<int, int>> pixel = {};  // x, y of an image pixel of that view, or of the first
};
PickedPoint pick_point(const render::Scene& scene, const views::ViewSet& views, const PointOptions& options);

/// The surface point that view `view` shows at the centre of pixel (x, y). Throws Error{kUsage} where that is
/// none of the asset's, or outside of the picture.
PickedPoint point_at(const render::Scene& scene, const views::ViewSet& views, int view, int x, int y);

/// Of the points that `view` shows (nullopt: the first view with any), one that as many views as possible
/// show well; of those one near the picture's middle that faces them. Throws Error{kUsage} if there is none.
PickedPoint best_point(const render::Scene& scene, const views::ViewSet& views,
                       std::optional<int> view = std::nullopt);

}  // namespace patina::pipeline
