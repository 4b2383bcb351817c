// What rays tell of a surface's shape, against closed forms. Cosine-weighted directions lie evenly over the
// unit disc when seen from above, so shares are areas of that disc.
#include "patina/masks/surface_shape.h"

#include <cmath>

#include <gtest/gtest.h>

#include "../render/scenes.h"

namespace patina::masks {
namespace {

namespace scenes = render::test;

constexpr ShapeRays kMany{.count = 4096, .seed = 3, .index = 5};

struct World {
  std::vector<scenes::Part> parts;
  asset::Asset asset;
  render::Scene scene;
  explicit World(std::vector<asset::Primitive> primitives)
      : parts([&] {
          std::vector<scenes::Part> out;
          for (asset::Primitive& p : primitives) out.push_back({std::move(p), {}});
          return out;
        }()),
        asset(scenes::make_asset(parts)),
        scene(asset, scenes::make_maps(parts), render::constant_environment(vec3(1.0f))) {}

  render::SurfacePoint point(const vec3& from, const vec3& to) const {
    const render::Ray ray{from, glm::normalize(to - from)};
    return scene.surface(ray, *scene.intersect(ray));
  }
};

// Share of the unit disc beyond a chord at distance a from its centre.
double segment(double a) {
  return a >= 1 ? 0.0 : (std::acos(a) - a * std::sqrt(1 - a * a)) / kPi;
}

TEST(SurfaceShape, a_plane_is_neither_closed_in_nor_bent) {
  const World world({scenes::floor(5.0f)});
  const auto point = world.point(vec3(0.3f, 2, 0.1f), vec3(0.3f, 0, 0.1f));
  EXPECT_EQ(closed_in(world.scene, point, 10.0f, kMany), 0.0f);
  EXPECT_EQ(bends_away(world.scene, point, 10.0f, kMany), 0.0f);
}

// From a point of a sphere of radius R a ray at angle θ to the axis meets it again after 2 R cos θ.
TEST(SurfaceShape, a_sphere_from_inside_is_closed_in_and_from_outside_bends_away) {
  const World world({scenes::sphere(vec3(0.0f), 2.0f, 128)});
  const auto inside = world.point(vec3(0.0f), vec3(0.3f, 0.2f, 1)),
             outside = world.point(vec3(0.9f, 0.6f, 6), vec3(0.0f));
  for (const float range : {0.5f, 1.0f, 2.0f}) {
    const float share = std::pow(range / 4.0f, 2.0f);
    EXPECT_NEAR(closed_in(world.scene, inside, range, kMany), share, 0.01f) << range;
    EXPECT_NEAR(bends_away(world.scene, outside, range, kMany), 2 * share, 0.02f) << range;
    EXPECT_EQ(closed_in(world.scene, outside, range, kMany), 0.0f);
  }
}

TEST(SurfaceShape, a_wall_hides_its_form_factor) {
  // A wall of height 1 along x, far longer than anything else here.
  const World world({scenes::floor(50.0f), scenes::quad(vec3(-500, 0, 0), vec3(1000, 0, 0), vec3(0, 1, 0))});
  for (const float d : {0.2f, 0.5f, 2.0f}) {
    const auto point = world.point(vec3(0, 3, d), vec3(0, 0, d));
    EXPECT_NEAR(closed_in(world.scene, point, 1e4f, kMany), 0.5f * (1 - d / std::hypot(d, 1.0f)), 0.01f) << d;
  }
}

TEST(SurfaceShape, a_cube_has_edges_and_a_thin_sheet_has_none) {
  // Top and front of a large cube, meeting at the x axis; and a sheet one millimetre thick, far away.
  const World world({scenes::quad(vec3(-50, 0, 0), vec3(100, 0, 0), vec3(0, 0, -50)),
                     scenes::quad(vec3(-50, -50, 0), vec3(100, 0, 0), vec3(0, 50, 0)),
                     scenes::floor(5.0f, 100.0f),
                     scenes::quad(vec3(-5, 99.999f, -5), vec3(10, 0, 0), vec3(0, 0, 10))});
  for (const float d : {0.01f, 0.25f, 0.5f, 0.9f}) {
    const auto top = world.point(vec3(0, 2, -d), vec3(0, 0, -d)),
               front = world.point(vec3(0, -d, 2), vec3(0, -d, 0));
    EXPECT_NEAR(bends_away(world.scene, top, 1.0f, kMany), 2 * segment(d), 0.02f) << d;
    EXPECT_NEAR(bends_away(world.scene, front, 1.0f, kMany), 2 * segment(d), 0.02f) << d;
  }
  EXPECT_EQ(bends_away(world.scene, world.point(vec3(0, 2, -1.2f), vec3(0, 0, -1.2f)), 1.0f, kMany), 0.0f);
  EXPECT_NEAR(bends_away(world.scene, world.point(vec3(1, 102, 1), vec3(1, 100, 1)), 1.0f, kMany), 0.0f,
              1e-3f);
}

// A tube around the y axis in the shape of a torus, R = 3 and r = 1: rays against the exact surface, found by
// small steps, must agree with rays against the mesh.
double torus_distance(const glm::dvec3& p) {
  return std::hypot(std::hypot(p.x, p.z) - 3, p.y) - 1;
}
asset::Primitive torus() {
  constexpr int kAround = 192, kTube = 96;
  asset::Primitive out;
  for (int i = 0; i <= kAround; ++i)
    for (int j = 0; j <= kTube; ++j) {
      const float a = 2 * kPi * static_cast<float>(i) / kAround, b = 2 * kPi * static_cast<float>(j) / kTube;
      const vec3 radial(std::cos(a), 0, std::sin(a));
      out.p_world.push_back((3 + std::cos(b)) * radial + vec3(0, std::sin(b), 0));
    }
  out.uv = {std::vector<vec2>(out.p_world.size(), vec2(0.5f))};
  for (uint32_t i = 0; i < kAround; ++i)
    for (uint32_t j = 0; j < kTube; ++j) {
      const uint32_t k = i * (kTube + 1) + j, below = k + kTube + 1;
      out.triangles.insert(out.triangles.end(), {{k, k + 1, below}, {below, k + 1, below + 1}});
    }
  return out;
}

TEST(SurfaceShape, a_torus_is_as_its_formula_says) {
  const World world({torus()});
  for (const auto& [from, to] : std::vector<std::pair<vec3, vec3>>{
           {{9, 0, 0}, {4, 0, 0}}, {{0, 0, 0}, {2, 0, 0}}, {{3, 5, 0}, {3, 1, 0}}}) {
    const auto point = world.point(from, to);
    const glm::dvec3 p(to), n(glm::normalize(vec3(point.n_geometric)));
    const Basis basis = orthonormal_basis(vec3(n));
    for (const double range : {0.8, 1.6}) {
      int outside_hits = 0, inside_hits = 0, count = 0;
      double turned = 0;
      for (int i = 0; i < 40; ++i)
        for (int j = 0; j < 40; ++j, ++count) {
          const double r = std::sqrt((i + 0.5) / 40), phi = 2 * M_PI * (j + 0.5) / 40;
          const glm::dvec3 flat =
              r * (std::cos(phi) * glm::dvec3(basis.tangent) + std::sin(phi) * glm::dvec3(basis.bitangent));
          for (const int side : {1, -1}) {
            const glm::dvec3 d = flat + side * std::sqrt(1 - r * r) * n;
            double t = 0.01;
            while (t < range && side * torus_distance(p + t * d) > 0) t += 0.004;
            if (t >= range) continue;
            if (side > 0) {
              ++outside_hits;
              continue;
            }
            ++inside_hits;
            const glm::dvec3 q = p + t * d;
            const glm::dvec3 ring = 3.0 * glm::normalize(glm::dvec3(q.x, 0, q.z));
            turned += std::clamp(1 + glm::dot(glm::normalize(q - ring), n), 0.0, 1.0);
          }
        }
      EXPECT_NEAR(closed_in(world.scene, point, static_cast<float>(range), kMany),
                  static_cast<double>(outside_hits) / count, 0.02);
      EXPECT_NEAR(bends_away(world.scene, point, static_cast<float>(range), kMany), 2 * turned / count, 0.04);
      EXPECT_TRUE(outside_hits + inside_hits > 0);
    }
  }
}

// A ridge along the middle of the texture, its sides tilted by s, and the same as a groove.
TEST(SurfaceShape, relief_is_the_tilt_of_ridges_and_minus_that_of_grooves) {
  World world({scenes::quad(vec3(0.0f), vec3(1, 0, 0), vec3(0, 1, 0))});
  constexpr float kTilt = 0.6f;
  const render::Ray ray{vec3(0.5f, 0.5f, 1), vec3(0, 0, -1)};
  const render::Hit hit = *world.scene.intersect(ray);
  for (const bool along_v : {false, true})
    for (const float sign : {1.0f, -1.0f}) {
      auto maps = scenes::make_maps(world.parts);
      maps[0].normal.texels = Image(32, 32, 3);
      for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x) {
          // Right of a ridge the normal leans right, above it up: green grows against v.
          const float side = sign * ((along_v ? 31 - y : x) < 16 ? -1.0f : 1.0f);
          const float z = std::sqrt(1 - kTilt * kTilt);
          maps[0].normal.texels.set_rgb(x, y, along_v ? vec3(0, side * kTilt, z) : vec3(side * kTilt, 0, z));
        }
      world.scene.set_asset_materials(maps);
      EXPECT_NEAR(relief(world.scene, hit, world.scene.surface(ray, hit), 0.2f), sign * kTilt, 1e-4f);
    }
  world.scene.set_asset_materials(scenes::make_maps(world.parts));
  EXPECT_EQ(relief(world.scene, hit, world.scene.surface(ray, hit), 0.2f), 0.0f);
}

}  // namespace
}  // namespace patina::masks
