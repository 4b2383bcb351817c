// Procedural objects and what is computed of their surfaces.
#include <cmath>

#include <gtest/gtest.h>

#include "make_dataset/mesh.h"
#include "make_dataset/objects.h"
#include "make_dataset/shapes.h"
#include "make_dataset/smooth.h"
#include "make_dataset/solids.h"
#include "patina/base/error.h"

namespace patina::make_dataset {
namespace {

// Six times the volume that the triangles enclose; positive where they face outward.
double volume6(const Mesh& mesh) {
  double sum = 0;
  for (const uvec3& t : mesh.triangles)
    sum += static_cast<double>(
        glm::dot(mesh.positions[t.x], glm::cross(mesh.positions[t.y], mesh.positions[t.z])));
  return sum;
}

TEST(Shapes, face_outward_whatever_their_proportions) {
  for (const std::string& kind : shape_kinds()) {
    if (kind == "cloth") continue;  // a sheet
    for (uint64_t seed = 0; seed < 4; ++seed) {
      const Shape shape = make_shape(kind, seed);
      EXPECT_FALSE(shape.words.empty());
      for (const vec3& p : shape.mesh.positions) ASSERT_TRUE(is_finite(p)) << kind << ' ' << seed;
      EXPECT_GT(volume6(shape.mesh), 0.01) << kind << ' ' << seed;
    }
  }
}

TEST(Shapes, differ_by_seed_and_repeat) {
  EXPECT_EQ(make_shape("vase", 3).mesh.positions, make_shape("vase", 3).mesh.positions);
  EXPECT_NE(make_shape("vase", 3).mesh.positions, make_shape("vase", 4).mesh.positions);
  EXPECT_THROW(make_shape("spoon", 1), Error);
}

TEST(Solids, bodies_have_the_volume_of_their_measures) {
  EXPECT_NEAR(volume6(rounded_box({1, 2, 3}, 0)) / 6, 48, 0.01);
  EXPECT_NEAR(volume6(superellipsoid({1, 1, 1}, 1, 1)) / 6, 4 * std::numbers::pi / 3, 0.03);
  EXPECT_NEAR(volume6(cylinder(1, 2, 0)) / 6, 2 * std::numbers::pi, 0.03);
  EXPECT_NEAR(volume6(icosphere(5)) / 6, 4 * std::numbers::pi / 3, 0.03);
}

TEST(Finished, edges_are_convex_faces_flat_and_the_unit_sphere_holds_all) {
  const Finished box = finished(rounded_box({1, 1, 1}, 0.03f));
  const asset::Primitive& mesh = box.asset.primitives[0];
  double edges = 0, faces = 0, num_edges = 0, num_faces = 0;
  for (size_t i = 0; i < mesh.p_world.size(); ++i) {
    EXPECT_LE(glm::length(mesh.p_world[i]), 1.0001f);
    EXPECT_NEAR(glm::length(mesh.n_world[i]), 1.0f, 1e-4f);
    vec3 a = glm::abs(mesh.p_world[i]) * std::sqrt(3.0f);  // of the cube, 1 on a face
    if (a.x > a.y) std::swap(a.x, a.y);
    if (a.y > a.z) std::swap(a.y, a.z);
    if (a.x > a.y) std::swap(a.x, a.y);
    if (a.y > 0.97f) edges += static_cast<double>(box.curvature_fine[i]), num_edges += 1;
    if (a.y < 0.7f) faces += static_cast<double>(box.curvature_fine[i]), num_faces += 1;
  }
  EXPECT_GT(edges / num_edges, 0.75);
  EXPECT_NEAR(faces / num_faces, 0.5, 0.03);
}

struct Mean {
  double sum = 0, count = 0;
  void add(float value) { sum += static_cast<double>(value), count += 1; }
  double value() const { return sum / count; }
};

TEST(Finished, a_groove_is_concave) {
  const Finished out =
      finished(lathe({{0, 0}, {0.5f, 0}, {0.5f, 1.0f}, {0.2f, 1.5f}, {0.5f, 2.0f}, {0.5f, 3}, {0, 3}}));
  const asset::Primitive& mesh = out.asset.primitives[0];
  const float radius = std::sqrt(1.5f * 1.5f + 0.5f * 0.5f);  // of the sphere that held the post
  Mean groove, wall;
  for (size_t i = 0; i < mesh.p_world.size(); ++i) {
    const float y = mesh.p_world[i].y * radius + 1.5f;
    if (std::abs(y - 1.5f) < 0.02f) groove.add(out.curvature_fine[i]);
    if (std::abs(y - 0.5f) < 0.1f) wall.add(out.curvature_fine[i]);
  }
  EXPECT_LT(groove.value(), wall.value() - 0.1);
  // A cylinder bends by 1/r, in units of the unit sphere: ½ + ½ tanh(3.16 / 14).
  EXPECT_NEAR(wall.value(), 0.61, 0.05);
}

TEST(Finished, water_starts_at_a_ledge_and_dries_on_its_way_down) {
  const Finished out =
      finished(lathe({{0, 0}, {0.5f, 0}, {0.5f, 1.9f}, {0.8f, 2.0f}, {0.5f, 2.1f}, {0.5f, 3}, {0, 3}}));
  const asset::Primitive& mesh = out.asset.primitives[0];
  const float radius = std::sqrt(1.5f * 1.5f + 0.5f * 0.5f);
  Mean near_ledge, far_from_ledge;
  for (size_t i = 0; i < mesh.p_world.size(); ++i) {
    const float y = mesh.p_world[i].y * radius + 1.5f;
    if (y > 1.65f && y < 1.8f) near_ledge.add(out.flow[i]);
    if (y > 0.6f && y < 0.8f) far_from_ledge.add(out.flow[i]);
  }
  EXPECT_GT(near_ledge.value(), far_from_ledge.value() + 0.1);
}

TEST(FillAround, continues_values_and_keeps_the_known) {
  constexpr int kWidth = 20, kHeight = 13;
  std::vector<uint8_t> valid(kWidth * kHeight);
  std::vector<float> plane(kWidth * kHeight);
  for (int y = 4; y < 9; ++y)
    for (int x = 5; x < 15; ++x) {
      const auto i = static_cast<size_t>(y * kWidth + x);
      valid[i] = 1;
      plane[i] = x < 10 ? 1.0f : 3.0f;
    }
  const std::vector<float> before = plane;
  fill_around(kWidth, kHeight, valid, plane);
  for (size_t i = 0; i < plane.size(); ++i) {
    if (valid[i]) {
      EXPECT_EQ(plane[i], before[i]);
    }
    EXPECT_GE(plane[i], 1.0f);
    EXPECT_LE(plane[i], 3.0f);
  }
  EXPECT_LT(plane[6 * kWidth + 4], 1.5f);
  EXPECT_GT(plane[6 * kWidth + 15], 2.2f);
}

TEST(ObjectPlans, a_longer_list_begins_with_the_shorter) {
  const auto few = object_plans(30), many = object_plans(90);
  ASSERT_EQ(few.size(), 30u);
  size_t assets = 0, held_out = 0;
  for (size_t i = 0; i < few.size(); ++i) EXPECT_EQ(few[i].name, many[i].name);
  for (const ObjectPlan& plan : many) {
    assets += !plan.words.empty();
    held_out += plan.held_out;
  }
  EXPECT_EQ(assets, 6u);
  EXPECT_GE(held_out, 5u);
  EXPECT_LE(held_out, 20u);
}

}  // namespace
}  // namespace patina::make_dataset
