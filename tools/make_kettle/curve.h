// Plane curves for lathed profiles and swept centre lines, by arc length.
#pragma once

#include <vector>

#include <glm/glm.hpp>

namespace patina::kettle {

using dvec2 = glm::dvec2;
using dvec3 = glm::dvec3;

/// A chain of points, walked by share of its length. Metres.
class Curve {
 public:
  explicit Curve(std::vector<dvec2> points);
  double length() const { return length_.back(); }
  dvec2 at(double t) const;       ///< t in [0,1], clamped
  dvec2 tangent(double t) const;  ///< unit, in the direction of growing t

 private:
  size_t segment(double distance) const;
  std::vector<dvec2> points_;
  std::vector<double> length_;  // up to each point
};

/// Fine chains for the usual pieces; joined with operator+.
std::vector<dvec2> line(dvec2 a, dvec2 b);
std::vector<dvec2> bezier(dvec2 a, dvec2 b, dvec2 c, dvec2 d);
std::vector<dvec2> arc(dvec2 center, double radius, double begin_degrees, double end_degrees);
std::vector<dvec2> operator+(std::vector<dvec2> a, const std::vector<dvec2>& b);

}  // namespace patina::kettle
