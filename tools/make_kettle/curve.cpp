#include "curve.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace patina::kettle {
namespace {

constexpr int kPieces = 512;  // of one Bézier or arc: so fine that normals taken from chords look smooth

}  // namespace

Curve::Curve(std::vector<dvec2> points) : points_(std::move(points)), length_{0.0} {
  for (size_t i = 1; i < points_.size(); ++i)
    length_.push_back(length_.back() + glm::length(points_[i] - points_[i - 1]));
}

size_t Curve::segment(double distance) const {
  const auto above = std::upper_bound(length_.begin(), length_.end(), distance);
  return std::clamp<size_t>(static_cast<size_t>(above - length_.begin()), 1, points_.size() - 1) - 1;
}

dvec2 Curve::at(double t) const {
  const double distance = std::clamp(t, 0.0, 1.0) * length();
  const size_t i = segment(distance);
  return glm::mix(points_[i], points_[i + 1], (distance - length_[i]) / (length_[i + 1] - length_[i]));
}

// Over a short stretch rather than one chord, so that normals do not show the chords.
dvec2 Curve::tangent(double t) const {
  constexpr double kStep = 0.01;
  const double middle = std::clamp(t, 0.0, 1.0);
  return glm::normalize(at(middle + kStep) - at(middle - kStep));
}

std::vector<dvec2> line(dvec2 a, dvec2 b) {
  return {a, b};
}

std::vector<dvec2> bezier(dvec2 a, dvec2 b, dvec2 c, dvec2 d) {
  std::vector<dvec2> out;
  for (int i = 0; i <= kPieces; ++i) {
    const double t = static_cast<double>(i) / kPieces, s = 1 - t;
    out.push_back(s * s * s * a + 3 * s * s * t * b + 3 * s * t * t * c + t * t * t * d);
  }
  return out;
}

std::vector<dvec2> arc(dvec2 center, double radius, double begin_degrees, double end_degrees) {
  std::vector<dvec2> out;
  for (int i = 0; i <= kPieces; ++i) {
    const double angle =
        glm::mix(begin_degrees, end_degrees, static_cast<double>(i) / kPieces) * std::numbers::pi / 180;
    out.push_back(center + radius * dvec2(std::cos(angle), std::sin(angle)));
  }
  return out;
}

std::vector<dvec2> operator+(std::vector<dvec2> a, const std::vector<dvec2>& b) {
  for (const dvec2& p : b)
    if (a.empty() || glm::length(p - a.back()) > 1e-9) a.push_back(p);
  return a;
}

}  // namespace patina::kettle
