#include "patina/asset/geometry.h"

#include <algorithm>

#include "patina/base/check.h"

namespace patina::asset {
namespace {

template <class T>
std::vector<T> gather(const std::vector<T>& values, const std::vector<uint32_t>& source) {
  std::vector<T> out;
  if (values.empty()) return out;
  out.reserve(source.size());
  for (const uint32_t i : source) out.push_back(values[i]);
  return out;
}

// Normal of a triangle times twice its area, in double: small far-off triangles would lose theirs to
// rounding.
glm::dvec3 area_normal(const Geometry& g, const uvec3& t) {
  const glm::dvec3 a(g.position[t.x]), b(g.position[t.y]), c(g.position[t.z]);
  return glm::cross(b - a, c - a);
}

double angle_between(const glm::dvec3& a, const glm::dvec3& b) {
  const double lengths = glm::length(a) * glm::length(b);
  return lengths > 0 ? std::acos(std::clamp(glm::dot(a, b) / lengths, -1.0, 1.0)) : 0.0;
}

}  // namespace

vec3 unit_or(const glm::dvec3& v, const vec3& otherwise) {
  const double length = glm::length(v);
  return length > 0 && std::isfinite(length) ? vec3(v / length) : otherwise;
}

glm::dvec3 origin_for(const Extent& extent) {
  // At 64 radii a float still holds steps of 4e-6 radii, a thousandth of a pixel of a view.
  constexpr double kFarRadii = 64;
  const glm::dvec3 center = 0.5 * (extent.low + extent.high);
  const double radius = 0.5 * glm::length(extent.high - extent.low);
  const bool is_far = std::isfinite(radius) && radius > 0 && glm::length(center) > kFarRadii * radius;
  return is_far ? center : glm::dvec3(0.0);
}

Geometry gathered(const Geometry& g, const std::vector<uint32_t>& source, std::vector<uvec3> triangles) {
  Geometry out;
  out.position = gather(g.position, source);
  out.normal = gather(g.normal, source);
  out.tangent = gather(g.tangent, source);
  for (const auto& set : g.uv) out.uv.push_back(gather(set, source));
  out.color = gather(g.color, source);
  out.triangles = std::move(triangles);
  return out;
}

bool has_uv_area(const std::vector<vec2>& uv, const std::vector<uvec3>& triangles) {
  return std::any_of(triangles.begin(), triangles.end(), [&](const uvec3& t) {
    const glm::dvec2 a(uv[t.x]), b = glm::dvec2(uv[t.y]) - a, c = glm::dvec2(uv[t.z]) - a;
    return b.x * c.y - b.y * c.x != 0.0;
  });
}

Geometry with_flat_normals(const Geometry& g) {
  std::vector<uint32_t> source;
  std::vector<uvec3> triangles;
  source.reserve(3 * g.triangles.size());
  triangles.reserve(g.triangles.size());
  for (const uvec3& t : g.triangles) {
    const auto first = static_cast<uint32_t>(source.size());
    triangles.emplace_back(first, first + 1, first + 2);
    source.insert(source.end(), {t.x, t.y, t.z});
  }
  Geometry out = gathered(g, source, std::move(triangles));
  out.tangent.clear();
  out.normal.resize(out.num_vertices());
  for (const uvec3& t : out.triangles) {
    const vec3 n = unit_or(area_normal(out, t), vec3(0, 0, 1));
    for (int k = 0; k < 3; ++k) out.normal[t[k]] = n;
  }
  return out;
}

void make_smooth_normals(Geometry& g) {
  std::vector<glm::dvec3> sum(g.num_vertices(), glm::dvec3(0.0));
  for (const uvec3& t : g.triangles) {
    const glm::dvec3 normal = area_normal(g, t);
    const double length = glm::length(normal);
    if (!(length > 0)) continue;
    for (int k = 0; k < 3; ++k) {
      const glm::dvec3 p(g.position[t[k]]);
      sum[t[k]] += normal / length *
                   angle_between(glm::dvec3(g.position[t[(k + 1) % 3]]) - p,
                                 glm::dvec3(g.position[t[(k + 2) % 3]]) - p);
    }
  }
  g.normal.resize(g.num_vertices(), vec3(0.0f));
  for (size_t i = 0; i < g.num_vertices(); ++i)
    if (!(glm::dot(g.normal[i], g.normal[i]) > 0.0f)) g.normal[i] = unit_or(sum[i], vec3(0, 0, 1));
}

}  // namespace patina::asset
