// Ray queries and surface points: what is hit, from which side, with which frame, and what transparency lets
// through.
#include "patina/render/scene.h"

#include <gtest/gtest.h>

#include "patina/base/random.h"
#include "patina/render/lights.h"
#include "patina/render/shading_normal.h"
#include "scenes.h"

namespace patina::render {
namespace {

using asset::AlphaMode;
using test::Part;

struct World {
  std::vector<Part> parts;
  asset::Asset asset;
  Scene scene;
  explicit World(std::vector<Part> parts_, std::vector<asset::MaterialMaps> maps = {})
      : parts(std::move(parts_)),
        asset(test::make_asset(parts)),
        scene(asset, maps.empty() ? test::make_maps(parts) : std::move(maps),
              constant_environment(vec3(1.0f))) {}
};

Ray down(float x, float z, float height = 5.0f) {
  return {{x, height, z}, {0, -1, 0}};
}

TEST(scene, hit_tells_primitive_triangle_and_place) {
  const World world({{test::floor(2.0f, 0.0f), {}}, {test::floor(1.0f, 1.0f), {}}});
  const auto top = world.scene.intersect(down(0.25f, 0.5f));
  ASSERT_TRUE(top.has_value());
  EXPECT_EQ(top->primitive, 1u);
  EXPECT_NEAR(top->t, 4.0f, 1e-6f);
  const SurfacePoint point = world.scene.surface(down(0.25f, 0.5f), *top);
  EXPECT_NEAR(glm::length(point.p_world - vec3(0.25f, 1.0f, 0.5f)), 0.0f, 1e-6f);
  EXPECT_EQ(point.material, 1);
  EXPECT_NEAR(point.uv[0].x, (0.25f + 1.0f) / 2.0f, 1e-6f);
  EXPECT_NEAR(point.uv[0].y, (0.5f + 1.0f) / 2.0f, 1e-6f);
  EXPECT_EQ(world.scene.intersect(down(1.5f, 0.0f))->primitive, 0u);
  EXPECT_FALSE(world.scene.intersect(down(3.0f, 0.0f)).has_value());
}

TEST(scene, occlusion_respects_the_segment) {
  const World world({{test::floor(1.0f), {}}});
  Ray ray = down(0.0f, 0.0f);
  EXPECT_TRUE(world.scene.occluded(ray));
  ray.t_max = 4.9f;
  EXPECT_FALSE(world.scene.occluded(ray));
  ray.t_max = 10.0f, ray.t_min = 5.1f;
  EXPECT_FALSE(world.scene.occluded(ray));
}

TEST(scene, normals_face_the_side_that_the_ray_came_from) {
  const World world({{test::floor(1.0f), {}}});
  const Ray above = down(0.2f, 0.3f), below{{0.2f, -5.0f, 0.3f}, {0, 1, 0}};
  const SurfacePoint front = world.scene.surface(above, *world.scene.intersect(above));
  const SurfacePoint back = world.scene.surface(below, *world.scene.intersect(below));
  EXPECT_TRUE(front.front_face);
  EXPECT_FALSE(back.front_face);
  for (const vec3 SurfacePoint::*n :
       {&SurfacePoint::n_geometric, &SurfacePoint::n_interpolated, &SurfacePoint::n_shading}) {
    EXPECT_NEAR((front.*n).y, 1.0f, 1e-6f);
    EXPECT_NEAR((back.*n).y, -1.0f, 1e-6f);
  }
  EXPECT_NEAR(glm::length(front.tangent + back.tangent), 0.0f,
              1e-6f);  // the frame turns round with the normal
}

TEST(scene, normal_map_is_read_in_the_tangent_frame) {
  std::vector<Part> parts{{test::floor(1.0f), {}}};
  asset::Primitive& floor = parts[0].primitive;
  auto maps = test::make_maps(parts);
  const vec3 mapped = glm::normalize(vec3(0.3f, 0.4f, 0.8f));
  maps[0].normal.texels.set_rgb(0, 0, mapped);
  for (const float sign : {1.0f, -1.0f}) {
    floor.tangent_world.assign(4, vec4(1, 0, 0, sign));
    const World world(parts, maps);
    const SurfacePoint point = world.scene.surface(down(0, 0), *world.scene.intersect(down(0, 0)));
    // b = w · cross(n, t) = w · cross(+Y, +X) = -w · Z
    const vec3 expected(mapped.x, mapped.z, -sign * mapped.y);
    EXPECT_NEAR(glm::length(point.n_shading - expected), 0.0f, 1e-5f);
  }
}

TEST(scene, vertex_normals_and_colours_are_interpolated) {
  std::vector<Part> parts{{test::floor(1.0f), {.base_color = vec3(0.5f)}}};
  parts[0].primitive.color = {
      {1, 0, 0, 1}, {0, 1, 0, 1}, {0, 1, 0, 1}, {1, 0, 0, 1}};  // red at x = -1, green at x = 1
  const World world(parts);
  const SurfacePoint point = world.scene.surface(down(0.5f, 0.1f), *world.scene.intersect(down(0.5f, 0.1f)));
  EXPECT_NEAR(point.bsdf.base_color.x, 0.5f * 0.25f, 1e-5f);
  EXPECT_NEAR(point.bsdf.base_color.y, 0.5f * 0.75f, 1e-5f);
  EXPECT_NEAR(point.bsdf.base_color.z, 0.0f, 1e-6f);
}

TEST(scene, maps_follow_their_uv_transform_and_set) {
  std::vector<Part> parts{{test::floor(1.0f), {}}};
  parts[0].primitive.uv.push_back({{0, 0}, {0, 0}, {0, 0}, {0, 0}});
  auto maps = test::make_maps(parts);
  maps[0].base_color.texels = Image(4, 1, 3);
  for (int x = 0; x < 4; ++x) maps[0].base_color.texels.set_rgb(x, 0, vec3(0.25f * static_cast<float>(x)));
  const auto base_at = [&](float x) {
    const World world(parts, maps);
    return world.scene.surface(down(x, 0.0f), *world.scene.intersect(down(x, 0.0f))).bsdf.base_color.x;
  };
  EXPECT_NEAR(base_at(-0.75f), 0.0f, 1e-5f);
  EXPECT_NEAR(base_at(0.25f), 0.5f, 1e-5f);
  maps[0].base_color.uv_transform[2] = vec3(0.25f, 0.0f, 1.0f);  // one texel further
  EXPECT_NEAR(base_at(0.25f), 0.75f, 1e-5f);
  maps[0].base_color.uv_set = 1;  // all zero: between the first and (wrapped) last texel, moved by one
  EXPECT_NEAR(base_at(0.25f), 0.125f, 1e-5f);
  maps[0].base_color.uv_set = 3;  // a set that the mesh lacks reads as zero
  EXPECT_NEAR(base_at(0.25f), 0.125f, 1e-5f);
}

/// A floor with a checker of 2 × 2 opacities as its alpha map.
World checker(AlphaMode mode, float cutoff = 0.5f) {
  std::vector<Part> parts{{test::floor(1.0f, 1.0f), {.alpha_mode = mode}}, {test::floor(1.0f, 0.0f), {}}};
  auto maps = test::make_maps(parts);
  maps[0].alpha.texels = Image(2, 2, 1);
  maps[0].alpha.texels.pixels = {0.2f, 0.4f, 0.6f, 0.9f};
  maps[0].alpha_cutoff = cutoff;
  return World(parts, maps);
}

TEST(scene, masked_texels_below_the_cutoff_are_holes) {
  const World world = checker(AlphaMode::kMask, 0.5f);
  // Texel centres lie at ±0.5; the map's top row is at -z.
  EXPECT_EQ(world.scene.intersect(down(-0.5f, -0.5f))->primitive, 1u);
  EXPECT_EQ(world.scene.intersect(down(0.5f, -0.5f))->primitive, 1u);
  EXPECT_EQ(world.scene.intersect(down(-0.5f, 0.5f))->primitive, 0u);
  EXPECT_EQ(world.scene.intersect(down(0.5f, 0.5f))->primitive, 0u);
  Ray segment = down(-0.5f, -0.5f);
  segment.t_max = 4.5f;
  EXPECT_FALSE(world.scene.occluded(segment));
  segment.origin.z = 0.5f;
  EXPECT_TRUE(world.scene.occluded(segment));
  // A texel whose alpha equals the cutoff is there [glTF2, Sec. 3.9.4].
  EXPECT_EQ(checker(AlphaMode::kMask, 0.4f).scene.intersect(down(0.5f, -0.5f))->primitive, 0u);
}

TEST(scene, opaque_materials_ignore_alpha) {
  const World world = checker(AlphaMode::kOpaque);
  EXPECT_EQ(world.scene.intersect(down(-0.5f, -0.5f))->primitive, 0u);
}

TEST(scene, blended_texels_are_hit_with_probability_alpha) {
  const World world = checker(AlphaMode::kBlend);
  const float alphas[] = {0.2f, 0.4f, 0.6f, 0.9f};
  for (int i = 0; i < 4; ++i) {
    const Ray ray = down(i % 2 == 0 ? -0.5f : 0.5f, i < 2 ? -0.5f : 0.5f);
    int hits = 0;
    for (int k = 0; k < 1000; ++k)
      hits += world.scene.intersect(ray, (static_cast<float>(k) + 0.5f) / 1000.0f)->primitive == 0u;
    EXPECT_NEAR(hits, 1000 * alphas[i], 1) << i;
    EXPECT_EQ(world.scene.intersect(ray)->primitive == 0u,
              alphas[i] > 0.5f);  // the default: alpha above one half
  }
}

TEST(scene, layers_of_blend_multiply_even_where_they_coincide) {
  for (const float gap : {0.5f, 0.0f}) {
    std::vector<Part> parts;
    for (int layer = 0; layer < 3; ++layer)
      parts.push_back({test::floor(1.0f, 1.0f + gap * static_cast<float>(layer)),
                       {.alpha = 0.5f, .alpha_mode = AlphaMode::kBlend}});
    const World world(parts);
    Ray ray = down(0.1f, 0.2f);
    int hits = 0, shadows = 0;
    for (int k = 0; k < 1000; ++k) {
      const float u = (static_cast<float>(k) + 0.5f) / 1000.0f;
      hits += world.scene.intersect(ray, u).has_value();
      shadows += world.scene.occluded(ray, u);
    }
    EXPECT_NEAR(hits, 875, 2) << "gap " << gap;
    EXPECT_EQ(hits, shadows);
  }
}

TEST(scene, spawned_rays_do_not_meet_their_own_surface) {
  RandomStream random(51, RandomPurpose::kTest, 0);
  for (const float scale : {1e-4f, 0.01f, 1.0f, 150.0f, 2e9f})
    for (const vec3& at : {vec3(0.0f), vec3(100.0f, -30.0f, 50.0f)}) {
      const World world(
          {{test::quad(scale * (at - vec3(1, 0, 1)), scale * vec3(2, 1, 0), scale * vec3(0, 0.3f, 2)), {}}});
      int leaks = 0, total = 0;
      for (int i = 0; i < 2000; ++i) {
        // A point anywhere on the square, seen from a random side, left in a random direction of that side.
        const vec3 p = scale * (at + vec3(-1, 0, -1) + random.uniform() * vec3(2, 1, 0) +
                                random.uniform() * vec3(0, 0.3f, 2));
        const vec3 from = glm::normalize(vec3(random.gaussian(), random.gaussian(), random.gaussian()));
        const Ray ray{p + scale * from, -from};
        const auto hit = world.scene.intersect(ray);
        if (!hit) continue;
        ++total;
        const SurfacePoint point = world.scene.surface(ray, *hit);
        vec3 out = glm::normalize(vec3(random.gaussian(), random.gaussian(), random.gaussian()));
        if (glm::dot(out, point.n_geometric) < 0.0f) out = -out;
        leaks += world.scene.occluded(spawn_ray(point, out));
      }
      EXPECT_GT(total, 1000);
      EXPECT_EQ(leaks, 0) << "scale " << scale << " at " << at.x;
    }
}

TEST(scene, spawned_segments_reach_a_facing_surface_unhindered) {
  for (const float scale : {1e-4f, 1.0f, 2e9f}) {
    const World world(
        {{test::floor(scale), {}},
         {test::quad(scale * vec3(-1, 1, -1), scale * vec3(2, 0, 0), scale * vec3(0, 0, 2)), {}}});
    const Ray ray{scale * vec3(0.3f, 0.5f, 0.1f), {0, -1, 0}};
    const SurfacePoint point = world.scene.surface(ray, *world.scene.intersect(ray));
    EXPECT_FALSE(world.scene.occluded(spawn_segment(point, scale * vec3(-0.4f, 1.0f, 0.7f))));
    EXPECT_TRUE(world.scene.occluded(spawn_segment(point, scale * vec3(-0.4f, 1.001f, 0.7f))));
  }
}

TEST(scene, context_comes_after_the_asset) {
  const std::vector<Part> parts{{test::floor(1.0f), {}}};
  const std::vector<Part> context_parts{{test::floor(1.0f, -1.0f), {}}, {test::floor(1.0f, -2.0f), {}}};
  const asset::Asset asset = test::make_asset(parts);
  asset::Asset context = test::make_asset(context_parts);
  context.lights.push_back({});
  Scene scene(asset, test::make_maps(parts), constant_environment(vec3(1.0f)), &context, {});
  EXPECT_EQ(scene.num_asset_primitives(), 1);
  EXPECT_EQ(scene.num_asset_materials(), 1);
  EXPECT_EQ(scene.primitives().size(), 3u);
  EXPECT_EQ(scene.materials().size(), 3u);
  EXPECT_EQ(scene.lights().size(), 1u);
  EXPECT_NEAR(scene.bounds().min.y, -2.0f, 1e-6f);
  const Ray from_below{{0, -5, 0}, {0, 1, 0}};
  const auto hit = scene.intersect(from_below);
  EXPECT_EQ(hit->primitive, 2u);
  EXPECT_EQ(scene.surface(from_below, *hit).material, 2);
}

TEST(scene, replaced_materials_show_and_shine) {
  const std::vector<Part> parts{{test::floor(1.0f), {.base_color = vec3(0.2f)}}};
  const asset::Asset asset = test::make_asset(parts);
  Scene scene(asset, test::make_maps(parts), constant_environment(vec3(0.0f)));
  EXPECT_FALSE(scene.light_sampler().has_extended());
  scene.set_asset_materials({test::maps({.base_color = vec3(0.7f), .emission = vec3(2.0f)})});
  EXPECT_TRUE(scene.light_sampler().has_extended());
  const SurfacePoint point = scene.surface(down(0, 0), *scene.intersect(down(0, 0)));
  EXPECT_NEAR(point.bsdf.base_color.x, 0.7f, 1e-6f);
  EXPECT_NEAR(point.emission.x, 2.0f, 1e-6f);
  EXPECT_THROW(scene.set_asset_materials({}), std::logic_error);
}

TEST(shading_normal, is_kept_where_it_can_be_seen_and_moved_no_further_than_needed) {
  RandomStream random(52, RandomPurpose::kTest, 0);
  int moved = 0;
  for (int i = 0; i < 5000; ++i) {
    const auto direction = [&] {
      return glm::normalize(vec3(random.gaussian(), random.gaussian(), random.gaussian()));
    };
    const vec3 n_geometric = direction();
    vec3 wo = direction(), n = direction();
    if (glm::dot(wo, n_geometric) < 0.0f) wo = -wo;
    if (glm::dot(n, n_geometric) < 0.0f) n = -n;
    const vec3 out = visible_shading_normal(n, n_geometric, wo);
    ASSERT_NEAR(glm::length(out), 1.0f, 1e-5f);
    ASSERT_GT(glm::dot(out, wo), 0.0f);
    ASSERT_GT(glm::dot(2.0f * glm::dot(out, wo) * out - wo, n_geometric), 0.0f);
    const bool could_stay =
        glm::dot(n, wo) > 0.05f && glm::dot(2.0f * glm::dot(n, wo) * n - wo, n_geometric) > 0.05f;
    if (could_stay) {
      ASSERT_EQ(out, n);
    }
    moved += out != n;
  }
  EXPECT_GT(moved, 500);
  EXPECT_LT(moved, 4500);
}

}  // namespace
}  // namespace patina::render
