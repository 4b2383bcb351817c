// Who sees what: single points, and shares of the surface with known answers.
#include <gtest/gtest.h>

#include "../render/scenes.h"
#include "patina/views/view_set.h"
#include "patina/views/visibility.h"

namespace patina::views {
namespace {

namespace scenes = render::test;

render::Scene make_scene(const asset::Asset& asset, std::vector<asset::MaterialMaps> maps) {
  return render::Scene(asset, std::move(maps), render::constant_environment(vec3(1.0f)));
}

TEST(SeenShare, one_camera_sees_the_cap_of_a_sphere) {
  const std::vector<scenes::Part> parts{{scenes::sphere(vec3(0.0f), 1.0f, 128), {}}};
  const asset::Asset asset = scenes::make_asset(parts);
  const render::Scene scene = make_scene(asset, scenes::make_maps(parts));
  for (const float distance : {2.0f, 4.0f, 10.0f}) {
    const render::Camera camera = render::look_at(vec3(0, 0, distance), vec3(0.0f), 1.5f, 64, 64);
    // The visible cap ends at the tangent: its share of the sphere is (1 − r/d)/2.
    EXPECT_NEAR(seen_share(scene, std::vector{camera}), 0.5f * (1.0f - 1.0f / distance), 0.006f) << distance;
  }
}

TEST(SeenShare, two_views_from_opposite_sides_share_nothing_of_a_sphere) {
  const std::vector<scenes::Part> parts{{scenes::sphere(vec3(0.0f), 1.0f, 64), {}}};
  const asset::Asset asset = scenes::make_asset(parts);
  const render::Scene scene = make_scene(asset, scenes::make_maps(parts));
  const std::vector cameras{render::look_at(vec3(0, 0, 4), vec3(0.0f), 0.6f, 64, 64),
                            render::look_at(vec3(0, 0, -4), vec3(0.0f), 0.6f, 64, 64)};
  EXPECT_NEAR(seen_share(scene, cameras, 1), 0.75f, 0.01f);
  EXPECT_EQ(seen_share(scene, cameras, 2), 0.0f);
}

TEST(UnseenSurface, is_told_by_the_side_it_faces) {
  const std::vector<scenes::Part> parts{{scenes::sphere(vec3(0.0f), 1.0f, 128), {}}};
  const asset::Asset asset = scenes::make_asset(parts);
  const render::Scene scene = make_scene(asset, scenes::make_maps(parts));
  // From far above, the upper half is seen. The cap steeper than 45 degrees has (1 - cos 45°)/2 of a sphere.
  const std::vector above{render::look_at(vec3(0, 1000, 0.001f), vec3(0.0f), 0.01f, 64, 64)};
  const UnseenSurface unseen = unseen_surface(scene, above);
  const float cap = 0.5f * (1.0f - std::sqrt(0.5f));
  EXPECT_NEAR(unseen.down, cap, 0.005f);
  EXPECT_EQ(unseen.up, 0.0f);
  EXPECT_NEAR(unseen.sideways, 0.5f - cap, 0.005f);
  EXPECT_NEAR(unseen.all(), 1.0f - seen_share(scene, above), 1e-6f);
  EXPECT_NEAR(unseen_surface(scene, {}).all(), 1.0f, 1e-6f);
}

TEST(SeenShare, what_leaves_the_image_hides_or_turns_away_is_not_seen) {
  const auto front = scenes::quad(vec3(-1, -1, 0), vec3(2, 0, 0), vec3(0, 2, 0));
  const auto back = scenes::quad(vec3(-1, -1, -1), vec3(2, 0, 0), vec3(0, 2, 0));
  const std::vector<scenes::Part> parts{{front, {}}, {back, {}}};
  const asset::Asset asset = scenes::make_asset(parts);
  auto maps = scenes::make_maps(parts);
  const render::Scene scene = make_scene(asset, maps);
  const std::vector far{render::look_at(vec3(0, 0, 1000), vec3(0.0f), 0.01f, 64, 64)};
  EXPECT_EQ(seen_share(scene, far, 1, 0), 1.0f);
  EXPECT_NEAR(seen_share(scene, far, 1, 1), 0.0f, 0.01f);  // hidden but for the rim that perspective shows
  EXPECT_NEAR(seen_share(scene, far), 0.5f, 0.01f);
  // The image ends in the middle of the front plane.
  const render::Camera half =
      render::look_at(vec3(50, 0, 100), vec3(50, 0, 0), 2.0f * std::atan(0.5f), 64, 64);
  EXPECT_NEAR(seen_share(scene, std::vector{half}, 1, 0), 0.5f, 0.01f);
  const std::vector behind{render::look_at(vec3(0, 0, -1000), vec3(0.0f), 0.01f, 64, 64)};
  EXPECT_EQ(seen_share(scene, behind), 0.0f);
  maps[1].double_sided = true;
  const render::Scene two_sided = make_scene(asset, maps);
  EXPECT_EQ(seen_share(two_sided, behind, 1, 1), 1.0f);
}

TEST(SeenAt, lands_on_the_projection_or_nowhere) {
  const std::vector<scenes::Part> parts{{scenes::sphere(vec3(0.0f), 1.0f, 64), {}}};
  const asset::Asset asset = scenes::make_asset(parts);
  const render::Scene scene = make_scene(asset, scenes::make_maps(parts));
  const render::Camera camera = render::look_at(vec3(0, 0, 4), vec3(0.0f), 0.6f, 64, 64);
  const vec3 toward = glm::normalize(vec3(0.3f, -0.2f, 1.0f));
  const auto front = front_hit(scene, render::Ray{3.0f * toward, -toward});
  ASSERT_TRUE(front);
  EXPECT_NEAR(glm::length(front->p_world), 1.0f, 0.01f);
  EXPECT_GT(front->cosine, 0.99f);
  const auto pixel = seen_at(scene, camera, front->p_world, front->n_world);
  ASSERT_TRUE(pixel);
  EXPECT_LT(glm::length(*pixel - camera.project(front->p_world)->pixel), 1e-4f);
  EXPECT_FALSE(seen_at(scene, camera, -front->p_world, -front->n_world));
  // The far side stays hidden even if its normal claims to face the camera.
  EXPECT_FALSE(seen_at(scene, camera, -front->p_world, front->n_world));
}

TEST(FrontHit, back_of_a_single_sided_surface_does_not_count) {
  const std::vector<scenes::Part> parts{{scenes::quad(vec3(-1, -1, 0), vec3(2, 0, 0), vec3(0, 2, 0)), {}}};
  const asset::Asset asset = scenes::make_asset(parts);
  auto maps = scenes::make_maps(parts);
  const render::Scene single = make_scene(asset, maps);
  const render::Ray from_behind{vec3(0, 0, -2), vec3(0, 0, 1)};
  EXPECT_FALSE(front_hit(single, from_behind));
  EXPECT_TRUE(front_hit(single, render::Ray{vec3(0, 0, 2), vec3(0, 0, -1)}));
  maps[0].double_sided = true;
  const render::Scene both = make_scene(asset, maps);
  const auto hit = front_hit(both, from_behind);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->n_world, vec3(0, 0, -1));
}

TEST(OpaqueAt, holes_of_a_mask_are_not_there) {
  scenes::Constant hole;
  hole.alpha = 0.0f;
  hole.alpha_mode = asset::AlphaMode::kMask;
  const auto quad = scenes::quad(vec3(-1, -1, 0), vec3(2, 0, 0), vec3(0, 2, 0));
  const std::vector<scenes::Part> solid_parts{{quad, {}}}, hole_parts{{quad, hole}};
  const asset::Asset solid_asset = scenes::make_asset(solid_parts),
                     hole_asset = scenes::make_asset(hole_parts);
  const render::Scene solid = make_scene(solid_asset, scenes::make_maps(solid_parts));
  const render::Scene masked = make_scene(hole_asset, scenes::make_maps(hole_parts));
  const vec3 eye(0, 0, 3), p(0.3f, 0.2f, 0.0f);
  EXPECT_TRUE(opaque_at(solid, eye, p));
  EXPECT_FALSE(opaque_at(masked, eye, p));
}

}  // namespace
}  // namespace patina::views
