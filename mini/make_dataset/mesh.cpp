#include "mesh.h"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <unordered_map>

#include "patina/base/check.h"

namespace patina::make_dataset {
namespace {

struct Key {
  int64_t x, y, z;
  bool operator==(const Key&) const = default;
};
struct KeyHash {
  size_t operator()(const Key& k) const {
    return static_cast<size_t>(k.x * 73856093 ^ k.y * 19349663 ^ k.z * 83492791);
  }
};

// Vertices nearer than 1e-5 of the object's size become one; triangles that lose a side go.
Mesh welded(const Mesh& mesh) {
  Mesh out;
  std::unordered_map<Key, uint32_t, KeyHash> seen;
  std::vector<uint32_t> renamed;
  for (const vec3& p : mesh.positions) {
    const Key key{std::llround(p.x * 1e5), std::llround(p.y * 1e5), std::llround(p.z * 1e5)};
    const auto [at, is_new] = seen.emplace(key, static_cast<uint32_t>(out.positions.size()));
    if (is_new) out.positions.push_back(p);
    renamed.push_back(at->second);
  }
  for (const uvec3& t : mesh.triangles) {
    const uvec3 r(renamed[t.x], renamed[t.y], renamed[t.z]);
    if (r.x != r.y && r.y != r.z && r.z != r.x) out.triangles.push_back(r);
  }
  return out;
}

// Into the unit sphere about the centre of the box.
void normalize(Mesh& mesh) {
  vec3 low(1e30f), high(-1e30f);
  for (const vec3& p : mesh.positions) low = glm::min(low, p), high = glm::max(high, p);
  const vec3 center = 0.5f * (low + high);
  float radius = 0;
  for (const vec3& p : mesh.positions) radius = std::max(radius, glm::length(p - center));
  PATINA_CHECK_LT(0.0f, radius);
  for (vec3& p : mesh.positions) p = (p - center) / radius;
}

// Halves every edge longer than `length`, on both its triangles alike, until none is left: large faces need
// vertices to carry curvature near their edges.
void split_long_edges(Mesh& mesh, float length) {
  for (int round = 0; round < 12; ++round) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middle;
    const auto split = [&](uint32_t a, uint32_t b) -> int64_t {
      if (glm::length(mesh.positions[a] - mesh.positions[b]) <= length) return -1;
      const auto [at, is_new] =
          middle.emplace(std::minmax(a, b), static_cast<uint32_t>(mesh.positions.size()));
      if (is_new) mesh.positions.push_back(0.5f * (mesh.positions[a] + mesh.positions[b]));
      return at->second;
    };
    std::vector<uvec3> out;
    bool any = false;
    for (const uvec3& t : mesh.triangles) {
      const std::array<int64_t, 3> m{split(t.x, t.y), split(t.y, t.z), split(t.z, t.x)};
      const int count = (m[0] >= 0) + (m[1] >= 0) + (m[2] >= 0);
      any |= count > 0;
      const auto add = [&](int64_t a, int64_t b, int64_t c) { out.emplace_back(a, b, c); };
      if (count == 0) {
        out.push_back(t);
      } else if (count == 3) {
        add(t.x, m[0], m[2]), add(m[0], t.y, m[1]), add(m[2], m[1], t.z), add(m[0], m[1], m[2]);
      } else {
        // Turned so that the first side is split, and with two splits the third is not.
        int turn = 0;
        while (m[static_cast<size_t>(turn)] < 0 ||
               (count == 2 && m[static_cast<size_t>((turn + 2) % 3)] >= 0))
          ++turn;
        const uint32_t a = t[turn], b = t[(turn + 1) % 3], c = t[(turn + 2) % 3];
        const int64_t ab = m[static_cast<size_t>(turn)], bc = m[static_cast<size_t>((turn + 1) % 3)];
        if (bc < 0) {
          add(a, ab, c), add(ab, b, c);
        } else {
          add(ab, b, bc), add(a, ab, bc), add(a, bc, c);
        }
      }
    }
    mesh.triangles = std::move(out);
    if (!any) return;
  }
}

struct Neighbours {
  std::vector<uint32_t> first, list;  // those of vertex i: list[first[i]] … list[first[i + 1] − 1]
};
Neighbours neighbours_of(const Mesh& mesh) {
  std::vector<std::pair<uint32_t, uint32_t>> edges;
  for (const uvec3& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      edges.emplace_back(t[i], t[(i + 1) % 3]);
      edges.emplace_back(t[(i + 1) % 3], t[i]);
    }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  Neighbours out;
  out.first.assign(mesh.positions.size() + 1, 0);
  for (const auto& [a, b] : edges) {
    ++out.first[a + 1];
    out.list.push_back(b);
  }
  std::partial_sum(out.first.begin(), out.first.end(), out.first.begin());
  return out;
}

std::vector<vec3> face_normals(const Mesh& mesh) {
  std::vector<vec3> out;  // twice the area long
  for (const uvec3& t : mesh.triangles)
    out.push_back(
        glm::cross(mesh.positions[t.y] - mesh.positions[t.x], mesh.positions[t.z] - mesh.positions[t.x]));
  return out;
}

// Diffuses per-vertex sums until a point has spread by a standard deviation of about `radius`. Neighbours
// weigh by one over their squared distance, and each vertex moves what makes its variance grow alike, so that
// long thin triangles spread no farther along than across.
std::vector<double> spread(const Mesh& mesh, const Neighbours& near, std::vector<double> value,
                           float radius) {
  constexpr int kSteps = 24;
  std::vector<double> weight(near.list.size()), next(value.size());
  for (size_t i = 0; i < value.size(); ++i)
    for (uint32_t k = near.first[i]; k < near.first[i + 1]; ++k) {
      const vec3 apart = mesh.positions[i] - mesh.positions[near.list[k]];
      weight[k] = 1.0 / std::max(static_cast<double>(glm::dot(apart, apart)), 1e-8);
    }
  for (int step = 0; step < kSteps; ++step) {
    for (size_t i = 0; i < value.size(); ++i) {
      double sum = 0, total = 0;
      for (uint32_t k = near.first[i]; k < near.first[i + 1]; ++k) {
        sum += weight[k] * value[near.list[k]];
        total += weight[k];
      }
      next[i] = value[i];
      if (!(total > 0)) continue;
      // Moving everything adds the variance Σ w d² / Σ w = n / Σ w. Where edges are far shorter than the
      // radius no more than most of a value moves in a step, and it spreads less far: there the mesh is dense
      // and smooth.
      const double variance = (near.first[i + 1] - near.first[i]) / total;
      const double moved = std::min(0.8, static_cast<double>(square(radius)) / (kSteps * variance));
      next[i] = (1 - moved) * value[i] + moved * sum / total;
    }
    value.swap(next);
  }
  return value;
}

// The mean over `radius` of what `sums` gives per area: both are spread, then divided, so that a vertex with
// little area counts little.
std::vector<float> mean_over(const Mesh& mesh, const Neighbours& near, const std::vector<double>& sums,
                             const std::vector<double>& area, float radius) {
  const auto above = spread(mesh, near, sums, radius), below = spread(mesh, near, area, radius);
  std::vector<float> out;
  for (size_t i = 0; i < above.size(); ++i)
    out.push_back(below[i] > 0 ? static_cast<float>(above[i] / below[i]) : 0.0f);
  return out;
}

// Mean curvature times two, summed over each vertex' area, from the angles between faces [Cohen-Steiner2003,
// Sec. 3.4]: Σ |e| θ_e, half to each end, positive where convex. It holds for rounded and for sharp edges
// alike.
std::vector<double> bending(const Mesh& mesh, const std::vector<vec3>& normals) {
  std::map<std::pair<uint32_t, uint32_t>, std::pair<size_t, uint32_t>>
      open;  // edge → first triangle, its far corner
  std::vector<double> sum(mesh.positions.size());
  for (size_t f = 0; f < mesh.triangles.size(); ++f) {
    const uvec3& t = mesh.triangles[f];
    for (int i = 0; i < 3; ++i) {
      const uint32_t a = t[i], b = t[(i + 1) % 3], far = t[(i + 2) % 3];
      const auto key = std::minmax(a, b);
      const auto at = open.find(key);
      if (at == open.end()) {
        open.emplace(key, std::pair{f, far});
        continue;
      }
      const vec3 n1 = normals[f], n2 = normals[at->second.first];
      const float lengths = glm::length(n1) * glm::length(n2);
      if (lengths > 0.0f) {
        const float angle = std::acos(glm::clamp(glm::dot(n1, n2) / lengths, -1.0f, 1.0f));
        // Convex where the other triangle's far corner lies below this one's plane.
        const float side =
            glm::dot(n1, mesh.positions[at->second.second] - mesh.positions[a]) < 0.0f ? 1.0f : -1.0f;
        const float share =
            0.5f * side * std::min(angle, 2.0f) * glm::length(mesh.positions[a] - mesh.positions[b]);
        sum[a] += static_cast<double>(share);
        sum[b] += static_cast<double>(share);
      }
      open.erase(at);
    }
  }
  return sum;
}

// Water starts where the surface folds inward or ends in a ledge, and runs to lower neighbours, drying on its
// way.
std::vector<float> flow_of(const Mesh& mesh, const Neighbours& near, const std::vector<float>& bend,
                           const std::vector<vec3>& normals) {
  std::vector<uint32_t> from_top(mesh.positions.size());
  std::iota(from_top.begin(), from_top.end(), 0u);
  std::stable_sort(from_top.begin(), from_top.end(),
                   [&](uint32_t a, uint32_t b) { return mesh.positions[a].y > mesh.positions[b].y; });
  std::vector<float> flow(mesh.positions.size());
  for (const uint32_t i : from_top) {
    const float source = glm::smoothstep(5.0f, 14.0f, std::abs(bend[i])) * (bend[i] < 0 ? 1.0f : 0.8f);
    double arriving = 0, weight = 0;
    for (uint32_t k = near.first[i]; k < near.first[i + 1]; ++k) {
      const uint32_t j = near.list[k];
      const vec3 down = mesh.positions[i] - mesh.positions[j];
      const float length = glm::length(down);
      if (!(down.y < 0.0f) || !(length > 0.0f)) continue;
      const double w = std::pow(-down.y / length, 6.0f);
      arriving += w * flow[j] * std::exp(down.y / 0.45f);
      weight += w;
    }
    // Water keeps to walls; it drops off where the surface looks down.
    const float holds = glm::smoothstep(-0.7f, -0.2f, normals[i].y);
    flow[i] = std::max(source, weight > 0 ? holds * static_cast<float>(arriving / weight) : 0.0f);
  }
  return flow;
}

}  // namespace

void append(Mesh& mesh, const Mesh& part, const mat4& placed) {
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  const bool mirrored = glm::determinant(mat3(placed)) < 0.0f;
  for (const vec3& p : part.positions) mesh.positions.push_back(vec3(placed * vec4(p, 1.0f)));
  for (uvec3 t : part.triangles) {
    if (mirrored) std::swap(t.y, t.z);
    mesh.triangles.push_back(t + uvec3(first));
  }
}

Mesh grid(int steps_u, int steps_v, const std::function<vec3(float, float)>& p) {
  Mesh out;
  for (int j = 0; j <= steps_v; ++j)
    for (int i = 0; i <= steps_u; ++i)
      out.positions.push_back(p(static_cast<float>(i) / static_cast<float>(steps_u),
                                static_cast<float>(j) / static_cast<float>(steps_v)));
  for (int j = 0; j < steps_v; ++j)
    for (int i = 0; i < steps_u; ++i) {
      const auto a = static_cast<uint32_t>(j * (steps_u + 1) + i), b = a + 1;
      const uint32_t c = b + static_cast<uint32_t>(steps_u) + 1, d = c - 1;
      out.triangles.emplace_back(a, b, c);
      out.triangles.emplace_back(a, c, d);
    }
  return out;
}

Finished finished(const Mesh& raw, float crease) {
  Mesh mesh = raw;
  normalize(mesh);
  mesh = welded(mesh);
  split_long_edges(mesh, 0.05f);
  const std::vector<vec3> faces = face_normals(mesh);
  const size_t num_vertices = mesh.positions.size();

  std::vector<double> area(num_vertices);
  std::vector<vec3> smooth(num_vertices);
  std::vector<std::vector<uint32_t>> faces_of(num_vertices);
  for (size_t f = 0; f < faces.size(); ++f)
    for (int i = 0; i < 3; ++i) {
      const uint32_t v = mesh.triangles[f][i];
      area[v] += static_cast<double>(glm::length(faces[f])) / 6.0;
      smooth[v] += faces[f];
      faces_of[v].push_back(static_cast<uint32_t>(f));
    }
  for (vec3& n : smooth) n = glm::length(n) > 0 ? glm::normalize(n) : vec3(0, 1, 0);

  const Neighbours near = neighbours_of(mesh);
  const std::vector<double> bend = bending(mesh, faces);
  std::vector<float> fine = mean_over(mesh, near, bend, area, 0.025f);
  std::vector<float> coarse = mean_over(mesh, near, bend, area, 0.09f);
  const std::vector<float> flow = flow_of(mesh, near, fine, smooth);
  // A right angle spread over its radius ends near the limits; a sphere of the object's size stays near the
  // middle.
  const auto coded = [](float bent, float unit) { return 0.5f + 0.5f * std::tanh(bent / unit); };
  for (float& value : fine) value = coded(value, 14.0f);
  for (float& value : coarse) value = coded(value - 2.0f, 6.0f);

  Finished out;
  asset::Primitive primitive;
  primitive.name = "object";
  for (size_t f = 0; f < mesh.triangles.size(); ++f) {
    if (!(glm::length(faces[f]) > 0.0f)) continue;
    const vec3 n = glm::normalize(faces[f]);
    for (int i = 0; i < 3; ++i) {
      const uint32_t v = mesh.triangles[f][i];
      vec3 sum(0.0f);
      for (const uint32_t other : faces_of[v])
        if (glm::dot(n, faces[other]) >= std::cos(crease) * glm::length(faces[other])) sum += faces[other];
      primitive.p_world.push_back(mesh.positions[v]);
      primitive.n_world.push_back(glm::length(sum) > 0 ? glm::normalize(sum) : n);
      out.curvature_fine.push_back(fine[v]);
      out.curvature_coarse.push_back(coarse[v]);
      out.flow.push_back(flow[v]);
    }
    const auto first = static_cast<uint32_t>(primitive.p_world.size()) - 3;
    primitive.triangles.emplace_back(first, first + 1, first + 2);
  }
  out.asset.primitives.push_back(std::move(primitive));
  asset::Material material;
  material.metallic_factor = 0.0f;
  material.double_sided = true;
  out.asset.materials.push_back(material);
  return out;
}

}  // namespace patina::make_dataset
