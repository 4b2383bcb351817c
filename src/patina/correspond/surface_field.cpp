#include "patina/correspond/surface_field.h"

#include <algorithm>
#include <cmath>

#include "patina/base/random.h"
#include "patina/render/triangle.h"

namespace patina::correspond {

// Points are dealt out along the running sum of area: triangle t gets the whole numbers between its two ends
// of the sum. So even triangles far smaller than a point's share get their due on average, and no rounding
// adds up.
SurfaceField::SurfaceField(const render::Scene& scene, double points_per_area, int64_t max_points) {
  std::vector<double> area_up_to{0.0};
  for (int primitive = 0; primitive < scene.num_asset_primitives(); ++primitive) {
    const auto p = static_cast<uint32_t>(primitive);
    const size_t count = scene.primitives()[p]->triangles.size();
    for (uint32_t triangle = 0; triangle < count; ++triangle) {
      triangles_.push_back({p, triangle});
      const float area = render::triangle_of(*scene.primitives()[p], triangle).area();
      area_up_to.push_back(area_up_to.back() + (std::isfinite(area) ? static_cast<double>(area) : 0.0));
    }
  }
  const double total = area_up_to.back();
  double density = total > 0.0 && std::isfinite(points_per_area) ? std::max(points_per_area, 0.0) : 0.0;
  if (density * total > static_cast<double>(max_points)) density = static_cast<double>(max_points) / total;
  first_point_.reserve(area_up_to.size());
  for (const double area : area_up_to)
    first_point_.push_back(static_cast<int64_t>(std::llround(density * area)));
}

size_t SurfaceField::triangle_of_point(int64_t point) const {
  const auto after = std::upper_bound(first_point_.begin(), first_point_.end(), point);
  return static_cast<size_t>(after - first_point_.begin()) - 1;
}

// The additive recurrence with the inverse powers of the plastic number covers the unit square more evenly
// than random points [Roberts2018]; folding its upper half over makes it a triangle. Each triangle starts at
// its own random place.
SurfaceField::Points SurfaceField::points_of(size_t index) {
  return {RandomStream(0, RandomPurpose::kNoiseField, index, 1).uniform2()};
}

vec2 SurfaceField::Points::at(int64_t n) const {
  constexpr double kStepX = 0.7548776662466927, kStepY = 0.5698402909980532;
  const double x = static_cast<double>(start.x) + kStepX * static_cast<double>(n);
  const double y = static_cast<double>(start.y) + kStepY * static_cast<double>(n);
  const vec2 in_square(static_cast<float>(x - std::floor(x)), static_cast<float>(y - std::floor(y)));
  return in_square.x + in_square.y > 1.0f ? vec2(1.0f) - in_square : in_square;
}

}  // namespace patina::correspond
