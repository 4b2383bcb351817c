#include "patina/asset/polygon.h"

#include <cmath>
#include <numeric>

namespace patina::asset {
namespace {

using glm::dvec2;
using glm::dvec3;

double cross(const dvec2& a, const dvec2& b, const dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

bool contains(const dvec2& a, const dvec2& b, const dvec2& c, const dvec2& p) {
  return cross(a, b, p) >= 0 && cross(b, c, p) >= 0 && cross(c, a, p) >= 0;
}

// The polygon on its plane, counter-clockwise.
std::vector<dvec2> projected(std::span<const vec3> corners) {
  const dvec3 n = polygon_normal(corners);
  const double length = glm::length(n);
  const Basis basis =
      orthonormal_basis(length > 0 && std::isfinite(length) ? vec3(n / length) : vec3(0, 0, 1));
  std::vector<dvec2> out;
  for (const vec3& p : corners) {
    const dvec3 from_first = dvec3(p) - dvec3(corners[0]);
    out.emplace_back(glm::dot(from_first, dvec3(basis.tangent)),
                     glm::dot(from_first, dvec3(basis.bitangent)));
  }
  return out;
}

void append_fan(const std::vector<uint32_t>& corners, std::vector<uvec3>& triangles) {
  for (size_t i = 1; i + 1 < corners.size(); ++i)
    triangles.emplace_back(corners[0], corners[i], corners[i + 1]);
}

}  // namespace

dvec3 polygon_normal(std::span<const vec3> corners) {
  dvec3 n(0.0);
  const dvec3 first(corners[0]);
  for (size_t i = 1; i + 1 < corners.size(); ++i)
    n += glm::cross(dvec3(corners[i]) - first, dvec3(corners[i + 1]) - first);
  return n;
}

std::vector<uvec3> triangulated(std::span<const vec3> corners) {
  constexpr size_t kMaxEarClipping = 512;  // cutting ears costs up to n^3
  std::vector<uint32_t> left(corners.size());
  std::iota(left.begin(), left.end(), 0u);
  std::vector<uvec3> triangles;
  if (corners.size() < 3) return triangles;
  const std::vector<dvec2> flat = projected(corners);
  bool convex = true;
  for (size_t i = 0, n = flat.size(); i < n && convex; ++i)
    convex = cross(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) >= 0;
  if (convex || corners.size() > kMaxEarClipping) {
    append_fan(left, triangles);
    return triangles;
  }
  // Cut off ears: convex corners whose triangle holds no other corner.
  while (left.size() > 3) {
    const size_t n = left.size();
    size_t ear = n;
    for (size_t i = 0; i < n && ear == n; ++i) {
      const uint32_t a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
      if (!(cross(flat[a], flat[b], flat[c]) > 0)) continue;
      bool empty = true;
      for (size_t k = 0; k < n && empty; ++k)
        empty = left[k] == a || left[k] == b || left[k] == c ||
                !contains(flat[a], flat[b], flat[c], flat[left[k]]);
      if (empty) ear = i;
    }
    if (ear == n) break;
    triangles.emplace_back(left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]);
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  append_fan(left, triangles);
  return triangles;
}

}  // namespace patina::asset
