// Tangent frames the MikkTSpace way [Mikkelsen2008, Sec. 3.2 to 3.4]: a vertex's tangent is the mean of the
// tangents of the triangles around it, projected onto the vertex's plane, weighted by their angles there.
// Triangles are averaged only with those that they reach over shared edges (corners equal in position, normal
// and UV) and whose UVs wind the same way, so mirrored halves keep tangents of their own. Baking tools do the
// same, which is why a baked normal map only looks right this way.
#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>
#include <unordered_map>

#include "patina/asset/geometry.h"
#include "patina/base/check.h"

namespace patina::asset {
namespace {

// ---- welding
// ------------------------------------------------------------------------------------------------------

using WeldKey = std::array<uint32_t, 8>;

struct WeldHash {
  size_t operator()(const WeldKey& key) const {
    uint64_t h = 0x9E3779B97F4A7C15u;
    for (const uint32_t word : key) {
      h = (h ^ word) * 0xFF51AFD7ED558CCDu;
      h ^= h >> 32;
    }
    return static_cast<size_t>(h);
  }
};

WeldKey weld_key(const vec3& p, const vec3& n, const vec2& t) {
  // Adding zero turns -0 into +0, which compare equal but differ in bits.
  const std::array<float, 8> values{p.x + 0.0f, p.y + 0.0f, p.z + 0.0f, n.x + 0.0f,
                                    n.y + 0.0f, n.z + 0.0f, t.x + 0.0f, t.y + 0.0f};
  WeldKey key;
  std::memcpy(key.data(), values.data(), sizeof key);
  return key;
}

// For each vertex the number of its welded vertex.
std::vector<uint32_t> welded_vertices(const Geometry& g, const std::vector<vec2>& uv) {
  std::unordered_map<WeldKey, uint32_t, WeldHash> known;
  known.reserve(g.num_vertices());
  std::vector<uint32_t> weld(g.num_vertices());
  for (size_t i = 0; i < weld.size(); ++i)
    weld[i] =
        known.try_emplace(weld_key(g.position[i], g.normal[i], uv[i]), static_cast<uint32_t>(known.size()))
            .first->second;
  return weld;
}

// ---- triangles
// ----------------------------------------------------------------------------------------------------

// How a triangle's UVs wind; one without UV area says nothing and goes with its neighbours.
enum class Winding : uint8_t { kNone, kSame, kMirrored };

struct TriangleFrame {
  glm::dvec3 tangent{0.0};  // direction of growing u, unit or zero
  Winding winding = Winding::kNone;
};

TriangleFrame triangle_frame(const Geometry& g, const std::vector<vec2>& uv, const uvec3& t) {
  const glm::dvec3 p0(g.position[t.x]), d1 = glm::dvec3(g.position[t.y]) - p0,
                                        d2 = glm::dvec3(g.position[t.z]) - p0;
  const glm::dvec2 u0(uv[t.x]);
  // MikkTSpace has v upwards, glTF downwards.
  const glm::dvec2 e1 = (glm::dvec2(uv[t.y]) - u0) * glm::dvec2(1, -1),
                   e2 = (glm::dvec2(uv[t.z]) - u0) * glm::dvec2(1, -1);
  const double area = e1.x * e2.y - e1.y * e2.x;
  if (area == 0.0 || !std::isfinite(area)) return {};
  const glm::dvec3 along_u = (d1 * e2.y - d2 * e1.y) * (area > 0 ? 1.0 : -1.0);
  const double length = glm::length(along_u);
  return {length > 0 ? along_u / length : glm::dvec3(0.0), area > 0 ? Winding::kSame : Winding::kMirrored};
}

// ---- groups
// -------------------------------------------------------------------------------------------------------

// Disjoint sets of corners.
class Groups {
 public:
  explicit Groups(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }
  uint32_t find(uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) { parent_[std::max(find(a), find(b))] = std::min(find(a), find(b)); }

 private:
  std::vector<uint32_t> parent_;
};

// An edge of a triangle as seen from one of its corners: corners of the same (vertex, other end) lie around
// the same edge.
struct CornerEdge {
  uint64_t edge;    // welded vertex of the corner and of the edge's other end
  uint32_t corner;  // 3 · triangle + k
};

Groups corner_groups(const Geometry& g, const std::vector<uint32_t>& weld,
                     const std::vector<TriangleFrame>& frames) {
  std::vector<CornerEdge> edges;
  edges.reserve(6 * g.triangles.size());
  for (size_t t = 0; t < g.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k)
      for (const int other : {(k + 1) % 3, (k + 2) % 3}) {
        const uint64_t v = weld[g.triangles[t][k]], w = weld[g.triangles[t][other]];
        if (v != w) edges.push_back({v << 32 | w, static_cast<uint32_t>(3 * t) + static_cast<uint32_t>(k)});
      }
  std::sort(edges.begin(), edges.end(), [](const CornerEdge& a, const CornerEdge& b) {
    return a.edge != b.edge ? a.edge < b.edge : a.corner < b.corner;
  });
  Groups groups(3 * g.triangles.size());
  std::vector<bool> adopted(3 * g.triangles.size(), false);
  for (size_t begin = 0, end; begin < edges.size(); begin = end) {
    std::array<int64_t, 3> first{-1, -1, -1};  // first corner of each winding around this edge
    for (end = begin; end < edges.size() && edges[end].edge == edges[begin].edge; ++end) {
      const uint32_t corner = edges[end].corner;
      const Winding winding = frames[corner / 3].winding;
      int64_t& known = first[static_cast<size_t>(winding)];
      if (known >= 0 && winding != Winding::kNone) groups.join(static_cast<uint32_t>(known), corner);
      if (known < 0) known = corner;
    }
    // A corner without UV area joins one neighbour's group, and only one: it must not bridge the two
    // windings.
    const int64_t host = std::max(first[1], first[2]);
    if (first[0] < 0 || host < 0) continue;
    for (size_t i = begin; i < end; ++i) {
      const uint32_t corner = edges[i].corner;
      if (frames[corner / 3].winding != Winding::kNone || adopted[corner]) continue;
      adopted[corner] = true;
      groups.join(static_cast<uint32_t>(host), corner);
    }
  }
  return groups;
}

glm::dvec3 on_plane(const glm::dvec3& v, const glm::dvec3& n) {
  return v - n * glm::dot(n, v);
}

glm::dvec3 unit_or_zero(const glm::dvec3& v) {
  const double length = glm::length(v);
  return length > 0 && std::isfinite(length) ? v / length : glm::dvec3(0.0);
}

}  // namespace

Geometry with_mikktspace_tangents(const Geometry& g, const std::vector<vec2>& uv) {
  PATINA_CHECK_EQ(g.normal.size(), g.num_vertices());
  PATINA_CHECK_EQ(uv.size(), g.num_vertices());
  const size_t num_triangles = g.triangles.size();
  std::vector<TriangleFrame> frames(num_triangles);
  for (size_t t = 0; t < num_triangles; ++t) frames[t] = triangle_frame(g, uv, g.triangles[t]);
  Groups groups = corner_groups(g, welded_vertices(g, uv), frames);

  // Sum the triangles' tangents over each group, on the corner's plane and weighted by the corner's angle on
  // it.
  struct Sum {
    glm::dvec3 tangent{0.0};
    Winding winding = Winding::kNone;
  };
  std::vector<Sum> sums(3 * num_triangles);
  for (size_t t = 0; t < num_triangles; ++t) {
    if (frames[t].winding == Winding::kNone) continue;
    for (int k = 0; k < 3; ++k) {
      const uvec3& v = g.triangles[t];
      const glm::dvec3 n(g.normal[v[k]]), p(g.position[v[k]]);
      const glm::dvec3 a = unit_or_zero(on_plane(glm::dvec3(g.position[v[(k + 1) % 3]]) - p, n));
      const glm::dvec3 b = unit_or_zero(on_plane(glm::dvec3(g.position[v[(k + 2) % 3]]) - p, n));
      const double angle = std::acos(std::clamp(glm::dot(a, b), -1.0, 1.0));
      Sum& sum = sums[groups.find(static_cast<uint32_t>(3 * t) + static_cast<uint32_t>(k))];
      sum.tangent += angle * unit_or_zero(on_plane(frames[t].tangent, n));
      sum.winding = frames[t].winding;
    }
  }

  // Corners of one vertex that belong to one group stay one vertex.
  std::vector<uint32_t> source;
  std::vector<vec4> tangents;
  std::vector<uvec3> triangles(num_triangles);
  std::unordered_map<uint64_t, uint32_t> made;
  made.reserve(g.num_vertices());
  for (size_t t = 0; t < num_triangles; ++t)
    for (int k = 0; k < 3; ++k) {
      const uint32_t vertex = g.triangles[t][k];
      const uint32_t group = groups.find(static_cast<uint32_t>(3 * t) + static_cast<uint32_t>(k));
      const auto [place, is_new] =
          made.try_emplace(uint64_t{vertex} << 32 | group, static_cast<uint32_t>(source.size()));
      triangles[t][k] = place->second;
      if (!is_new) continue;
      source.push_back(vertex);
      const glm::dvec3 tangent = unit_or_zero(sums[group].tangent);
      // Nothing to go by (no UV area around): any direction in the plane.
      const vec3 unit =
          tangent == glm::dvec3(0.0) ? orthonormal_basis(g.normal[vertex]).tangent : vec3(tangent);
      tangents.emplace_back(unit, sums[group].winding == Winding::kMirrored ? -1.0f : 1.0f);
    }
  Geometry out = gathered(g, source, std::move(triangles));
  out.tangent = std::move(tangents);
  return out;
}

}  // namespace patina::asset
