#include "solids.h"

#include <algorithm>
#include <array>
#include <map>

namespace patina::make_dataset {
namespace {

float signed_power(float x, float e) {
  return std::copysign(std::pow(std::abs(x), e), x);
}

template <class V>
std::vector<V> catmull_rom(const std::vector<V>& points, int steps) {
  std::vector<V> out;
  const auto at = [&](size_t i, int step) {
    const auto j = static_cast<ptrdiff_t>(i) + step;
    return points[static_cast<size_t>(
        std::clamp<ptrdiff_t>(j, 0, static_cast<ptrdiff_t>(points.size()) - 1))];
  };
  for (size_t i = 0; i + 1 < points.size(); ++i)
    for (int s = 0; s < steps; ++s) {
      const float t = static_cast<float>(s) / static_cast<float>(steps), t2 = t * t, t3 = t2 * t;
      out.push_back(0.5f * (2.0f * at(i, 0) + (at(i, 1) - at(i, -1)) * t +
                            (2.0f * at(i, -1) - 5.0f * at(i, 0) + 4.0f * at(i, 1) - at(i, 2)) * t2 +
                            (3.0f * at(i, 0) - at(i, -1) - 3.0f * at(i, 1) + at(i, 2)) * t3));
    }
  out.push_back(points.back());
  return out;
}

}  // namespace

// The surface of a cube whose points are pulled onto a smaller cube plus a sphere.
Mesh rounded_box(const vec3& half, float radius) {
  const float r = std::min({radius, half.x, half.y, half.z});
  const vec3 inner = half - vec3(r);
  const int steps = 20;
  Mesh out;
  for (int axis = 0; axis < 3; ++axis)
    for (const float sign : {-1.0f, 1.0f}) {
      append(out, grid(steps, steps, [&](float u, float v) {
               // Points are dense near the edges, where the surface bends.
               const auto eased = [&](float t, float extent) {
                 const float share = std::min(0.5f * r / extent, 0.45f), k = 0.25f;
                 const float s = t < k       ? t / k * share
                                 : t > 1 - k ? 1 - (1 - t) / k * share
                                             : share + (t - k) / (1 - 2 * k) * (1 - 2 * share);
                 return (2 * s - 1) * extent;
               };
               const int a = (axis + 1) % 3, b = (axis + 2) % 3;
               vec3 p;
               p[axis] = sign * half[axis];
               p[a] = eased(sign > 0 ? u : v, half[a]);
               p[b] = eased(sign > 0 ? v : u, half[b]);
               const vec3 core = glm::clamp(p, -inner, inner);
               const vec3 away = p - core;
               return r > 0 && glm::length(away) > 0 ? core + r * glm::normalize(away) : p;
             }));
    }
  return out;
}

Mesh superellipsoid(const vec3& half, float e_vertical, float e_horizontal) {
  return grid(96, 64, [&](float u, float v) {
    const float a = -2 * kPi * u, b = kPi * (v - 0.5f);
    const float c = signed_power(std::cos(b), e_vertical);
    return half * vec3(c * signed_power(std::cos(a), e_horizontal), signed_power(std::sin(b), e_vertical),
                       c * signed_power(std::sin(a), e_horizontal));
  });
}

// Long pieces of the profile are cut, so that triangles come out about as long as wide and carry curvature
// evenly.
Mesh lathe(const std::vector<vec2>& outline, int flutes, float flute_depth) {
  constexpr float kLongest = 0.06f;
  std::vector<vec2> profile{outline.front()};
  for (size_t i = 1; i < outline.size(); ++i) {
    const int pieces =
        std::max(1, static_cast<int>(std::ceil(glm::length(outline[i] - outline[i - 1]) / kLongest)));
    for (int k = 1; k <= pieces; ++k)
      profile.push_back(
          glm::mix(outline[i - 1], outline[i], static_cast<float>(k) / static_cast<float>(pieces)));
  }
  const int steps = std::max(96, 12 * flutes);
  const auto last = static_cast<float>(profile.size() - 1);
  return grid(steps, static_cast<int>(profile.size()) - 1, [&](float u, float v) {
    const auto i = static_cast<size_t>(std::lround(v * last));
    const float angle = u < 1.0f ? -2 * kPi * u : 0.0f;  // exactly closed
    float radius = profile[i].x;
    if (flutes > 0)
      radius *= 1.0f - flute_depth * square(std::sin(0.5f * static_cast<float>(flutes) * angle));
    return vec3(radius * std::cos(angle), profile[i].y, radius * std::sin(angle));
  });
}

Mesh tube(const std::vector<vec3>& path, const std::vector<float>& radii, bool closed) {
  constexpr int kAround = 28;
  // Frames carried along the path without twist.
  const size_t n = path.size();
  std::vector<vec3> tangent(n), side(n);
  for (size_t i = 0; i < n; ++i) {
    const size_t a = i > 0 ? i - 1 : (closed ? n - 2 : 0), b = i + 1 < n ? i + 1 : (closed ? 1 : n - 1);
    tangent[i] = glm::normalize(path[b] - path[a]);
  }
  side[0] = orthonormal_basis(tangent[0]).tangent;
  for (size_t i = 1; i < n; ++i)
    side[i] = glm::normalize(side[i - 1] - glm::dot(side[i - 1], tangent[i]) * tangent[i]);
  Mesh out;
  const auto last = static_cast<float>(n - 1);
  append(out, grid(kAround, static_cast<int>(n) - 1, [&](float u, float v) {
           const auto i = static_cast<size_t>(std::lround(v * last));
           const float angle = u < 1.0f ? 2 * kPi * u : 0.0f;
           return path[i] +
                  radii[i] * (std::cos(angle) * side[i] + std::sin(angle) * glm::cross(tangent[i], side[i]));
         }));
  if (!closed) {
    for (const bool at_end : {false, true}) {
      const auto first = static_cast<uint32_t>(out.positions.size());
      const size_t i = at_end ? n - 1 : 0;
      out.positions.push_back(path[i]);
      for (int k = 0; k < kAround; ++k) {
        const auto row = static_cast<uint32_t>(i * (kAround + 1));
        const auto a = row + static_cast<uint32_t>(k), b = a + 1;
        out.triangles.push_back(at_end ? uvec3(first, a, b) : uvec3(first, b, a));
      }
    }
  }
  return out;
}

Mesh prism(const std::vector<vec2>& polygon, float half_depth, float bevel) {
  // Rings from the back's middle to the front's: the caps are a little smaller than the outline.
  const auto n = static_cast<int>(polygon.size());
  const auto ring = [&](int k) -> std::pair<float, float> {  // how far inside, z
    switch (k) {
      case 0:
        return {1.0f, -half_depth};
      case 1:
        return {bevel, -half_depth};
      case 2:
        return {0.0f, -half_depth + bevel};
      case 3:
        return {0.0f, half_depth - bevel};
      case 4:
        return {bevel, half_depth};
      default:
        return {1.0f, half_depth};
    }
  };
  return grid(n, 5, [&](float u, float v) {
    const auto i = static_cast<size_t>(std::lround(u * static_cast<float>(n)) % n);
    const int k = static_cast<int>(std::lround(v * 5));
    const auto [inside, z] = ring(k);
    const vec2 p = polygon[i];
    const float length = std::max(glm::length(p), 1e-6f);
    const vec2 q = k == 0 || k == 5 ? vec2(0.0f) : p * (1.0f - inside / length);
    return vec3(q, z);
  });
}

Mesh icosphere(int rounds) {
  const float t = 0.5f * (1.0f + std::sqrt(5.0f));
  Mesh mesh;
  mesh.positions = {{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
                    {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
  mesh.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                    {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                    {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (vec3& p : mesh.positions) p = glm::normalize(p);
  for (int round = 0; round < rounds; ++round) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middle;
    const auto between = [&](uint32_t a, uint32_t b) {
      const auto [at, is_new] =
          middle.emplace(std::minmax(a, b), static_cast<uint32_t>(mesh.positions.size()));
      if (is_new) mesh.positions.push_back(glm::normalize(mesh.positions[a] + mesh.positions[b]));
      return at->second;
    };
    std::vector<uvec3> finer;
    for (const uvec3& f : mesh.triangles) {
      const uint32_t a = between(f.x, f.y), b = between(f.y, f.z), c = between(f.z, f.x);
      for (const uvec3& part : {uvec3(f.x, a, c), uvec3(a, f.y, b), uvec3(c, b, f.z), uvec3(a, b, c)})
        finer.push_back(part);
    }
    mesh.triangles = std::move(finer);
  }
  return mesh;
}

std::vector<vec2> smooth_curve(const std::vector<vec2>& points, int steps) {
  return catmull_rom(points, steps);
}
std::vector<vec3> smooth_curve(const std::vector<vec3>& points, int steps) {
  return catmull_rom(points, steps);
}

mat4 placed(const vec3& offset, float degrees, const vec3& axis, const vec3& scale) {
  return glm::scale(glm::rotate(glm::translate(mat4(1.0f), offset), glm::radians(degrees), axis), scale);
}

Profile joined(Profile a, const Profile& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Profile vessel(const Profile& outer, float wall) {
  Profile out = outer;
  const vec2 rim = outer.back();
  out.push_back({rim.x - 0.3f * wall, rim.y + 0.4f * wall});
  out.push_back({rim.x - 0.7f * wall, rim.y + 0.4f * wall});
  for (size_t i = outer.size(); i-- > 0;)
    out.push_back({std::max(outer[i].x - wall, 0.0f), std::max(outer[i].y, outer.front().y + wall)});
  out.back().x = 0.0f;
  return out;
}

Mesh torus_mesh(float large, float small, float arc) {
  std::vector<vec3> path;
  for (int i = 0; i <= 64; ++i) {
    const float a = 2 * kPi * arc * static_cast<float>(i) / 64;
    path.emplace_back(large * std::cos(a), large * std::sin(a), 0.0f);
  }
  return tube(path, std::vector<float>(path.size(), small), arc >= 1.0f);
}

Mesh cylinder(float radius, float height, float bevel) {
  return lathe({{0, 0},
                {radius - bevel, 0},
                {radius - 0.3f * bevel, 0.3f * bevel},
                {radius, bevel},
                {radius, height - bevel},
                {radius - 0.3f * bevel, height - 0.3f * bevel},
                {radius - bevel, height},
                {0, height}});
}

Mesh bent_tube(const std::vector<vec3>& points, float from, float to) {
  const auto path = smooth_curve(points, 12);
  std::vector<float> radii;
  for (size_t i = 0; i < path.size(); ++i)
    radii.push_back(glm::mix(from, to, static_cast<float>(i) / static_cast<float>(path.size() - 1)));
  return tube(path, radii);
}

}  // namespace patina::make_dataset
