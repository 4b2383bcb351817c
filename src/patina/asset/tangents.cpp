// MikkTSpace tangents [Mikkelsen2008, Sec. 3.2 to 3.4]: a vertex's tangent is the mean of the tangents of the
// triangles around it, projected onto the vertex's plane, weighted by their angles there. Triangles are
// averaged only with those that they reach over shared edges (corners equal in position, normal and UV) and
// whose UVs wind the same way, so mirrored halves keep tangents of their own. Baking tools do the same, which
// is why a baked normal map only looks right this way.
//
// Sums are in float and in the order of the published implementation, so that results are the same to the bit
// (docs/decisions/0017-tangents-are-mikktspace-to-the-bit.md); this file is compiled without contraction to
// fused multiply-adds. UVs are taken as the file has them, v downwards, and the sign is turned at the end.
#include <algorithm>
#include <array>
#include <cfloat>
#include <cstring>
#include <optional>
#include <unordered_map>

#include "patina/asset/geometry.h"
#include "patina/base/check.h"

namespace patina::asset {
namespace {

constexpr int32_t kNone = -1;

// ---- welding
// ------------------------------------------------------------------------------------------------------

template <size_t kWords>
struct WordsHash {
  size_t operator()(const std::array<uint32_t, kWords>& key) const {
    uint64_t h = 0x9E3779B97F4A7C15u;
    for (const uint32_t word : key) {
      h = (h ^ word) * 0xFF51AFD7ED558CCDu;
      h ^= h >> 32;
    }
    return static_cast<size_t>(h);
  }
};
template <size_t kWords>
using NumberOf = std::unordered_map<std::array<uint32_t, kWords>, uint32_t, WordsHash<kWords>>;

std::array<uint32_t, 8> weld_key(const vec3& p, const vec3& n, const vec2& t) {
  // Adding zero turns -0 into +0, which compare equal but differ in bits.
  const std::array<float, 8> values{p.x + 0.0f, p.y + 0.0f, p.z + 0.0f, n.x + 0.0f,
                                    n.y + 0.0f, n.z + 0.0f, t.x + 0.0f, t.y + 0.0f};
  std::array<uint32_t, 8> key;
  std::memcpy(key.data(), values.data(), sizeof key);
  return key;
}

// For each vertex the number of its welded vertex.
std::vector<uint32_t> welded_vertices(const Geometry& g, const std::vector<vec2>& uv) {
  NumberOf<8> known;
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

bool is_zero(float x) {
  return !(std::abs(x) > FLT_MIN);
}

vec3 unit_or_as_it_is(const vec3& v) {
  if (is_zero(v.x) && is_zero(v.y) && is_zero(v.z)) return v;
  return 1.0f / std::sqrt(glm::dot(v, v)) * v;
}

vec3 on_plane(const vec3& v, const vec3& n) {
  return unit_or_as_it_is(v - glm::dot(n, v) * n);
}

enum class Kind : uint8_t {
  kGood,
  kWithoutArea,  // its UVs have none: it says nothing and goes with its neighbours
  kDegenerate,   // two of its corners lie in one place: it connects nothing
};

struct Triangle {
  Kind kind = Kind::kGood;
  bool keeps_winding = false;                              // UVs wind as positions do
  vec3 along_u{0.0f}, along_v{0.0f};                       // directions of growing u and v, unit or zero
  std::array<int32_t, 3> neighbours{kNone, kNone, kNone};  // over the edges from corner k to k + 1
};

Triangle triangle_of(const Geometry& g, const std::vector<vec2>& uv, const uvec3& t) {
  Triangle out;
  const vec3 p0 = g.position[t.x], p1 = g.position[t.y], p2 = g.position[t.z];
  if (p0 == p1 || p0 == p2 || p1 == p2) {
    out.kind = Kind::kDegenerate;
    return out;
  }
  const vec3 d1 = p1 - p0, d2 = p2 - p0;
  const vec2 e1 = uv[t.y] - uv[t.x], e2 = uv[t.z] - uv[t.x];
  const float area = e1.x * e2.y - e1.y * e2.x;
  out.keeps_winding = area > 0.0f;
  out.kind = Kind::kWithoutArea;
  if (is_zero(area) || !std::isfinite(area)) return out;
  const vec3 along_u = e2.y * d1 - e1.y * d2, along_v = -e2.x * d1 + e1.x * d2;  // Eq. 18 and 19
  const float sign = out.keeps_winding ? 1.0f : -1.0f;
  const float length_u = std::sqrt(glm::dot(along_u, along_u)),
              length_v = std::sqrt(glm::dot(along_v, along_v));
  if (!is_zero(length_u)) out.along_u = sign / length_u * along_u;
  if (!is_zero(length_v)) out.along_v = sign / length_v * along_v;
  if (!is_zero(length_u / std::abs(area)) && !is_zero(length_v / std::abs(area))) out.kind = Kind::kGood;
  return out;
}

// ---- neighbours
// ---------------------------------------------------------------------------------------------------

struct Edge {
  uint64_t ends;  // welded vertices, the lower one first
  uint32_t triangle;
  uint8_t number;  // from corner `number` to the next
  bool rises;      // from the lower vertex to the higher one
};

// Two triangles that pass one edge in opposite directions are neighbours, each of one other at most.
void find_neighbours(const std::vector<uint32_t>& corners, std::vector<Triangle>& triangles) {
  std::vector<Edge> edges;
  edges.reserve(corners.size());
  for (size_t t = 0; t < triangles.size(); ++t) {
    if (triangles[t].kind == Kind::kDegenerate) continue;
    for (size_t k = 0; k < 3; ++k) {
      const uint64_t from = corners[3 * t + k], to = corners[3 * t + (k + 1) % 3];
      edges.push_back({std::min(from, to) << 32 | std::max(from, to), static_cast<uint32_t>(t),
                       static_cast<uint8_t>(k), from < to});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return a.ends != b.ends ? a.ends < b.ends : a.triangle < b.triangle;
  });
  const auto place = [&](const Edge& edge) -> int32_t& {
    return triangles[edge.triangle].neighbours[edge.number];
  };
  for (size_t i = 0; i < edges.size(); ++i) {
    if (place(edges[i]) != kNone) continue;
    for (size_t j = i + 1; j < edges.size() && edges[j].ends == edges[i].ends; ++j) {
      if (edges[j].rises == edges[i].rises || place(edges[j]) != kNone) continue;
      place(edges[i]) = static_cast<int32_t>(edges[j].triangle);
      place(edges[j]) = static_cast<int32_t>(edges[i].triangle);
      break;
    }
  }
}

// ---- groups
// -------------------------------------------------------------------------------------------------------

// Corners around one vertex that share a tangent.
struct Group {
  bool keeps_winding = false;
  std::vector<uint32_t> corners;  // 3 · triangle + k, ascending
};

struct Groups {
  std::vector<Group> all;
  std::vector<int32_t> of_corner;  // kNone: of no group
};

size_t corner_at(const std::vector<uint32_t>& corners, size_t triangle, uint32_t vertex) {
  size_t corner = 3 * triangle;
  while (corners[corner] != vertex) ++corner;
  return corner;
}

// Whether the corner joins: one of a triangle without UV area takes the winding of the first group that it
// joins.
bool joins(size_t corner, const Group& group, const Groups& groups, std::vector<Triangle>& triangles) {
  if (groups.of_corner[corner] != kNone) return false;
  Triangle& triangle = triangles[corner / 3];
  const auto first = groups.of_corner.begin() + static_cast<std::ptrdiff_t>(corner / 3 * 3);
  if (triangle.kind == Kind::kWithoutArea &&
      std::all_of(first, first + 3, [](int32_t group_of) { return group_of == kNone; }))
    triangle.keeps_winding = group.keeps_winding;
  return triangle.keeps_winding == group.keeps_winding;
}

Groups group_corners(const std::vector<uint32_t>& corners, std::vector<Triangle>& triangles) {
  Groups groups;
  groups.of_corner.assign(corners.size(), kNone);
  std::vector<size_t> open;
  for (size_t seed = 0; seed < corners.size(); ++seed) {
    if (triangles[seed / 3].kind != Kind::kGood || groups.of_corner[seed] != kNone) continue;
    const auto number = static_cast<int32_t>(groups.all.size());
    Group& group = groups.all.emplace_back();
    group.keeps_winding = triangles[seed / 3].keeps_winding;
    open.assign(1, seed);
    while (!open.empty()) {
      const size_t corner = open.back();
      open.pop_back();
      if (!joins(corner, group, groups, triangles)) continue;
      groups.of_corner[corner] = number;
      group.corners.push_back(static_cast<uint32_t>(corner));
      const size_t t = corner / 3, k = corner % 3;
      for (const int32_t next : {triangles[t].neighbours[k], triangles[t].neighbours[(k + 2) % 3]})
        if (next != kNone) open.push_back(corner_at(corners, static_cast<size_t>(next), corners[corner]));
    }
    std::sort(group.corners.begin(), group.corners.end());
  }
  return groups;
}

// ---- tangents
// -----------------------------------------------------------------------------------------------------

// What a corner adds to its group's tangent.
struct Share {
  vec3 along_u, along_v;  // on the vertex's plane
  float angle = 0;
  bool counts = false;  // its triangle has UV area
};

Share share_of(const Geometry& g, const Triangle& triangle, const uvec3& vertices, int k) {
  const vec3 n = g.normal[vertices[k]], p = g.position[vertices[k]];
  const vec3 a = on_plane(g.position[vertices[(k + 2) % 3]] - p, n),
             b = on_plane(g.position[vertices[(k + 1) % 3]] - p, n);
  const double cosine = std::clamp(glm::dot(a, b), -1.0f, 1.0f);
  return {on_plane(triangle.along_u, n), on_plane(triangle.along_v, n), static_cast<float>(std::acos(cosine)),
          triangle.kind == Kind::kGood};
}

// Triangles of one group whose tangents are exactly opposite are not averaged.
bool average(const Share& a, const Share& b) {
  return !a.counts || !b.counts || &a == &b ||
         (glm::dot(a.along_u, b.along_u) > -1.0f && glm::dot(a.along_v, b.along_v) > -1.0f);
}

// Whether no two of the shares can be opposite, told in linear time.
bool lie_together(const std::vector<Share>& shares) {
  constexpr float kCosine = 0.1f;  // of 84 degrees: two directions within that of a third are not opposite
  const auto first = std::find_if(shares.begin(), shares.end(), [](const Share& s) { return s.counts; });
  return std::all_of(shares.begin(), shares.end(), [&](const Share& s) {
    return !s.counts ||
           (glm::dot(s.along_u, first->along_u) > kCosine && glm::dot(s.along_v, first->along_v) > kCosine);
  });
}

vec3 mean_tangent(const std::vector<Share>& shares, const Share* only_with) {
  vec3 sum(0.0f);
  for (const Share& share : shares)
    if (share.counts && (!only_with || average(*only_with, share))) sum = sum + share.angle * share.along_u;
  return unit_or_as_it_is(sum);
}

// One tangent a corner, w the bitangent's sign; nullopt where no triangle around tells one.
std::vector<std::optional<vec4>> corner_tangents(const Geometry& g, const std::vector<Triangle>& triangles,
                                                 const Groups& groups) {
  std::vector<std::optional<vec4>> tangents(3 * triangles.size());
  std::vector<Share> shares;
  for (const Group& group : groups.all) {
    shares.clear();
    for (const uint32_t corner : group.corners)
      shares.push_back(
          share_of(g, triangles[corner / 3], g.triangles[corner / 3], static_cast<int>(corner % 3)));
    const bool together = lie_together(shares);
    const vec3 common = mean_tangent(shares, nullptr);
    for (size_t i = 0; i < shares.size(); ++i) {
      const vec3 tangent = together ? common : mean_tangent(shares, &shares[i]);
      const float length = glm::dot(tangent, tangent);
      // v grows downwards here and upwards in MikkTSpace.
      if (length > 0.5f && std::isfinite(length))
        tangents[group.corners[i]] = vec4(tangent, group.keeps_winding ? -1.0f : 1.0f);
    }
  }
  return tangents;
}

// Corners of degenerate triangles take the tangent of the first other corner at their vertex.
void fill_degenerate(const std::vector<uint32_t>& corners, const std::vector<Triangle>& triangles,
                     std::vector<std::optional<vec4>>& tangents) {
  std::unordered_map<uint32_t, size_t> first_at;
  for (size_t corner = 0; corner < corners.size(); ++corner)
    if (triangles[corner / 3].kind != Kind::kDegenerate) first_at.try_emplace(corners[corner], corner);
  for (size_t corner = 0; corner < corners.size(); ++corner) {
    if (triangles[corner / 3].kind != Kind::kDegenerate) continue;
    if (const auto found = first_at.find(corners[corner]); found != first_at.end())
      tangents[corner] = tangents[found->second];
  }
}

}  // namespace

Geometry with_mikktspace_tangents(const Geometry& g, const std::vector<vec2>& uv) {
  PATINA_CHECK_EQ(g.normal.size(), g.num_vertices());
  PATINA_CHECK_EQ(uv.size(), g.num_vertices());
  const std::vector<uint32_t> weld = welded_vertices(g, uv);
  std::vector<Triangle> frames;
  std::vector<uint32_t> corners;  // welded vertices
  for (const uvec3& t : g.triangles) {
    frames.push_back(triangle_of(g, uv, t));
    corners.insert(corners.end(), {weld[t.x], weld[t.y], weld[t.z]});
  }
  find_neighbours(corners, frames);
  const Groups groups = group_corners(corners, frames);
  std::vector<std::optional<vec4>> at_corner = corner_tangents(g, frames, groups);
  fill_degenerate(corners, frames, at_corner);

  // Corners of one vertex that have one tangent stay one vertex.
  std::vector<uint32_t> source;
  std::vector<vec4> tangents;
  std::vector<uvec3> triangles(g.triangles.size());
  NumberOf<5> made;
  made.reserve(g.num_vertices());
  for (size_t corner = 0; corner < corners.size(); ++corner) {
    const auto k = static_cast<int>(corner % 3);
    const uint32_t vertex = g.triangles[corner / 3][k];
    // Where nothing tells a direction, any in the plane will do.
    const vec4 tangent = at_corner[corner].value_or(vec4(orthonormal_basis(g.normal[vertex]).tangent, 1.0f));
    std::array<uint32_t, 5> key{vertex};
    std::memcpy(&key[1], &tangent, sizeof tangent);
    const auto [place, is_new] = made.try_emplace(key, static_cast<uint32_t>(source.size()));
    triangles[corner / 3][k] = place->second;
    if (!is_new) continue;
    source.push_back(vertex);
    tangents.push_back(tangent);
  }
  Geometry out = gathered(g, source, std::move(triangles));
  out.tangent = std::move(tangents);
  return out;
}

}  // namespace patina::asset
