// A white-noise field on the asset's surface: points spread evenly over all triangles, each with a value that
// is made from its index when it is asked for. It needs no UVs, so seams, mirrored, overlapping, tiled or
// missing UVs cannot disturb it.
#pragma once

#include <cstdint>
#include <vector>

#include "patina/render/scene.h"

namespace patina::correspond {

/// Points are numbered 0 .. num_points() - 1, triangle after triangle; no two share a value.
class SurfaceField {
 public:
  /// About `points_per_area` points a square metre over the asset's triangles, at most `max_points` in all.
  SurfaceField(const render::Scene& scene, double points_per_area, int64_t max_points);

  int64_t num_points() const { return first_point_.empty() ? 0 : first_point_.back(); }
  size_t num_triangles() const { return triangles_.size(); }

  struct TriangleRef {
    uint32_t primitive, triangle;
  };
  TriangleRef triangle(size_t index) const { return triangles_[index]; }
  /// Points of triangle `index` (counted over all of the asset's primitives) are first_point(index) ..
  /// first_point(index + 1) - 1.
  int64_t first_point(size_t index) const { return first_point_[index]; }
  /// The triangle that owns a point.
  size_t triangle_of_point(int64_t point) const;
  /// Where the points of a triangle lie.
  struct Points {
    vec2 start;  // in the unit square
    /// Weights of the triangle's second and third vertex for its n-th point.
    vec2 at(int64_t n) const;
  };
  static Points points_of(size_t index);

 private:
  std::vector<TriangleRef> triangles_;
  std::vector<int64_t> first_point_;  // [num_triangles + 1]
};

}  // namespace patina::correspond
