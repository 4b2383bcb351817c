// Correspondences against the definition of [Hadadan2025, Sec. 4.3], a plane's homography, and occluders.
#include <set>

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/correspond/correspondences.h"
#include "worlds.h"

namespace patina::correspond {
namespace {

using namespace test;

bool seen(const vec2& landing) {
  return !std::isnan(landing.x) && !std::isnan(landing.y);
}

// Latent pixel j = (view, x, y) as an index over the whole grid.
size_t pixel_index(const Correspondences& c, size_t view, int x, int y) {
  const int row = static_cast<int>(view) / c.grid, column = static_cast<int>(view) % c.grid;
  return static_cast<size_t>((row * c.view_height + y) * c.grid * c.view_width + column * c.view_width + x);
}
size_t num_pixels(const Correspondences& c) {
  return static_cast<size_t>(c.grid * c.view_width) * static_cast<size_t>(c.grid * c.view_height);
}

// B > 0 of the paper, built the slow way: for each pair of pixels of two views cast j's ray, project, test
// that nothing is in the way, and ask whether the point falls into the window around i. Points on the asset's
// front only.
std::vector<std::set<int32_t>> dense_bias(const render::Scene& scene,
                                          const std::vector<render::Camera>& cameras, int divisor,
                                          int radius) {
  const int grid = static_cast<int>(std::lround(std::sqrt(static_cast<double>(cameras.size()))));
  const int width = (cameras[0].width + divisor - 1) / divisor,
            height = (cameras[0].height + divisor - 1) / divisor;
  const int total = grid * width * grid * height;
  std::vector<std::set<int32_t>> keys(static_cast<size_t>(total));
  const auto place = [&](int index) {
    const int gx = index % (grid * width), gy = index / (grid * width);
    return std::tuple(static_cast<size_t>(gy / height * grid + gx / width), gx % width, gy % height);
  };
  for (int j = 0; j < total; ++j) {
    const auto [view_j, xj, yj] = place(j);
    const auto d = static_cast<float>(divisor);
    const render::Ray ray =
        cameras[view_j].ray(d * vec2(static_cast<float>(xj) + 0.5f, static_cast<float>(yj) + 0.5f));
    const auto hit = scene.intersect(ray);
    if (!hit || static_cast<int>(hit->primitive) >= scene.num_asset_primitives()) continue;
    const render::SurfacePoint p = scene.surface(ray, *hit);
    if (!p.front_face) continue;
    for (int i = 0; i < total; ++i) {
      const auto [view_i, xi, yi] = place(i);
      if (view_i == view_j) continue;
      const auto projection = cameras[view_i].project(p.p_world);
      if (!projection) continue;
      const vec2 q = projection->pixel / d;
      const bool inside = q.x >= 0 && q.y >= 0 &&
                          projection->pixel.x < static_cast<float>(cameras[view_i].width) &&
                          projection->pixel.y < static_cast<float>(cameras[view_i].height);
      const bool in_window = std::abs(static_cast<int>(std::floor(q.x)) - xi) <= radius &&
                             std::abs(static_cast<int>(std::floor(q.y)) - yi) <= radius;
      if (!inside || !in_window) continue;
      const vec3 eye = cameras[view_i].position();
      if (!(glm::dot(p.n_geometric, eye - p.p_world) > 0.0f)) continue;
      const float distance = glm::length(p.p_world - eye);
      const auto blocker = scene.intersect(render::Ray{eye, (p.p_world - eye) / distance});
      if (blocker && blocker->t < distance * (1.0f - 1e-4f)) continue;
      keys[static_cast<size_t>(i)].insert(j);
    }
  }
  return keys;
}

// The keys that the contract's words give a query: the buckets of the cells in its window, clipped to its
// view.
std::set<int32_t> keys_of(const attention::KeyBuckets& b, int query) {
  std::set<int32_t> keys;
  const int gx = query % b.width(), gy = query / b.width();
  const int x0 = gx / b.view_width * b.view_width, y0 = gy / b.view_height * b.view_height;
  for (int y = std::max(gy - b.window_radius, y0);
       y <= std::min(gy + b.window_radius, y0 + b.view_height - 1); ++y)
    for (int x = std::max(gx - b.window_radius, x0);
         x <= std::min(gx + b.window_radius, x0 + b.view_width - 1); ++x) {
      const auto cell = static_cast<size_t>(y * b.width() + x);
      for (int32_t k = b.offsets[cell]; k < b.offsets[cell + 1]; ++k)
        keys.insert(b.keys[static_cast<size_t>(k)]);
    }
  return keys;
}

World crowded_world() {
  // A sphere, a wall behind it that it hides in part, and a post of the context before both.
  return make_world({{scenes::sphere(vec3(0.0f), 0.7f, 24), {}},
                     {scenes::quad(vec3(-1.5f, -1, -1), vec3(3, 0, 0), vec3(0, 2, 0)), {}}},
                    {{scenes::quad(vec3(-0.15f, -1, 1.1f), vec3(0.3f, 0, 0), vec3(0, 2, 0)), {}}});
}

TEST(Correspondences, buckets_hold_exactly_the_papers_pairs) {
  const World world = crowded_world();
  for (const auto& [resolution, divisor] : {std::pair(64, 8), std::pair(72, 16), std::pair(40, 16)}) {
    const auto cameras = cameras_at({-35, 0, 25, 60}, resolution);
    for (const int radius : {0, 1, 4}) {
      const auto expected = dense_bias(*world.scene, cameras, divisor, radius);
      const attention::KeyBuckets buckets =
          bucket_keys(find_correspondences(*world.scene, cameras, divisor), radius);
      EXPECT_EQ(buckets.window_radius, radius);
      ASSERT_EQ(static_cast<size_t>(buckets.num_pixels()), expected.size());
      size_t pairs = 0;
      for (int query = 0; query < buckets.num_pixels(); ++query) {
        EXPECT_EQ(keys_of(buckets, query), expected[static_cast<size_t>(query)]) << "query " << query;
        pairs += expected[static_cast<size_t>(query)].size();
      }
      EXPECT_GT(pairs, 20u);  // the scene does test something
    }
  }
}

TEST(Correspondences, plane_lands_where_its_homography_says) {
  const World world = make_world({{scenes::quad(vec3(-20, -20, 0), vec3(40, 0, 0), vec3(0, 40, 0)), {}}});
  const auto cameras = cameras_at({-30, 0, 20, 45}, 128);
  const Correspondences found = find_correspondences(*world.scene, cameras, 8);
  const size_t n = num_pixels(found);
  int landed = 0;
  for (size_t from = 0; from < 4; ++from)
    for (size_t to = 0; to < 4; ++to) {
      if (to == from) continue;
      // H maps homogeneous pixels of `from` to those of `to`: K R' (R⁻¹ − (c' − c) m ᵀ/ d) K⁻¹, here with the
      // points of the plane z = 0 as its coordinates: pixel → plane → pixel, each a 3 × 3 matrix.
      const auto pixel_from_plane = [](const render::Camera& camera) {
        const mat4 view = glm::inverse(camera.world_from_camera);
        const float f = camera.focal_pixels(), cx = 0.5f * static_cast<float>(camera.width);
        const mat3 project(vec3(f, 0, 0), vec3(0, -f, 0),
                           vec3(-cx, -cx, -1));  // columns: x, y, z of the camera's frame
        const mat3 place{vec3(view[0]), vec3(view[1]),
                         vec3(view[3])};  // plane (x, y, 1) → the camera's frame
        return project * place;
      };
      const mat3 h = pixel_from_plane(cameras[to]) * glm::inverse(pixel_from_plane(cameras[from]));
      for (int y = 0; y < 16; ++y)
        for (int x = 0; x < 16; ++x) {
          const vec3 q =
              h * vec3(8.0f * (static_cast<float>(x) + 0.5f), 8.0f * (static_cast<float>(y) + 0.5f), 1.0f);
          const vec2 expected = vec2(q) / q.z / 8.0f;
          const vec2 landing = found.landing[to * n + pixel_index(found, from, x, y)];
          const bool inside =
              expected.x > 0.001f && expected.y > 0.001f && expected.x < 15.999f && expected.y < 15.999f;
          if (inside) {
            ASSERT_TRUE(seen(landing));
            EXPECT_LT(glm::length(landing - expected), 1e-3f);
            ++landed;
          } else if (expected.x < -0.001f || expected.y < -0.001f || expected.x > 16.001f ||
                     expected.y > 16.001f) {
            EXPECT_FALSE(seen(landing));
          }
        }
    }
  EXPECT_GT(landed, 1000);
}

TEST(Correspondences, own_view_background_and_context_have_none) {
  const World world = crowded_world();
  const auto cameras = cameras_at({-35, 0, 25, 60}, 128);
  const Correspondences found = find_correspondences(*world.scene, cameras, 8);
  const size_t n = num_pixels(found);
  ASSERT_EQ(found.landing.size(), 4 * n);
  for (size_t view = 0; view < 4; ++view)
    for (int y = 0; y < found.view_height; ++y)
      for (int x = 0; x < found.view_width; ++x) {
        const size_t j = pixel_index(found, view, x, y);
        EXPECT_FALSE(seen(found.landing[view * n + j]));
        const auto hit = world.scene->intersect(
            cameras[view].ray(8.0f * vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)));
        if (hit && hit->primitive < 2) continue;
        for (size_t other = 0; other < 4; ++other) EXPECT_FALSE(seen(found.landing[other * n + j]));
      }
}

TEST(Correspondences, occluder_hides_exactly_its_shadow) {
  const auto wall = scenes::quad(vec3(-4, -4, 0), vec3(8, 0, 0), vec3(0, 8, 0));
  const auto post = scenes::quad(vec3(-0.5f, -4, 1), vec3(1, 0, 0), vec3(0, 8, 0));
  const World world = make_world({{wall, {}}}, {{post, {}}});
  const vec3 eye_a(3, 0, 4), eye_b(-2, 0, 4);
  const render::Camera a = render::look_at(eye_a, vec3(0.0f), 0.6f, 128, 128);
  const render::Camera b = render::look_at(eye_b, vec3(0.0f), 0.9f, 128, 128);
  const Correspondences found = find_correspondences(*world.scene, std::vector{a, b, b, b}, 8);
  const size_t n = num_pixels(found);
  int hidden = 0, open = 0;
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x) {
      const render::Ray ray = a.ray(8.0f * vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
      const float at_post = ray.origin.x + ray.direction.x * (1.0f - ray.origin.z) / ray.direction.z;
      const vec3 p = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
      if (std::abs(at_post) < 0.5f) continue;  // a itself sees the post there
      // Where the segment from eye_b to p crosses the post's plane z = 1.
      const float crossing = glm::mix(p.x, eye_b.x, 1.0f / eye_b.z);
      if (std::abs(std::abs(crossing) - 0.5f) < 1e-3f) continue;
      const bool in_shadow = std::abs(crossing) < 0.5f;
      const auto projection = b.project(p);
      const bool inside = projection && projection->pixel.x > 0 && projection->pixel.x < 128 &&
                          projection->pixel.y > 0 && projection->pixel.y < 128;
      EXPECT_EQ(seen(found.landing[n + pixel_index(found, 0, x, y)]), inside && !in_shadow) << x << ' ' << y;
      hidden += in_shadow;
      open += !in_shadow;
    }
  EXPECT_GT(hidden, 10);
  EXPECT_GT(open, 10);
}

TEST(Correspondences, correspondence_is_mutual) {
  // Where j of view a lands in cell i of view b, i's point lies near j's again unless an edge lies between.
  const World world = sphere_world(UvState::kClean, 64);
  const auto cameras = cameras_at({0, 15, 30, 45}, 512);
  const Correspondences found = find_correspondences(*world.scene, cameras, 8);
  const size_t n = num_pixels(found);
  int checked = 0, returned = 0;
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) {
      const vec2 q = found.landing[n + pixel_index(found, 0, x, y)];
      if (!seen(q)) continue;
      const vec2 back = found.landing[pixel_index(found, 1, static_cast<int>(q.x), static_cast<int>(q.y))];
      ++checked;
      returned += seen(back) &&
                  glm::length(back - vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)) < 1.5f;
    }
  EXPECT_GT(checked, 1500);
  EXPECT_GT(returned, 0.95 * checked);
}

TEST(Correspondences, back_faces_are_excluded_but_both_sides_of_a_double_sided_sheet_correspond) {
  const auto sheet = scenes::quad(vec3(-4, -4, 0), vec3(8, 0, 0), vec3(0, 8, 0));
  const render::Camera behind = render::look_at(vec3(0, 0, -5), vec3(0.0f), 0.5f, 64, 64);
  const render::Camera beside = render::look_at(vec3(1, 0, -5), vec3(0.0f), 0.5f, 64, 64);
  const render::Camera front = render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 64, 64);
  const std::vector cameras{behind, beside, front, front};
  const World single = make_world({{sheet, {}}});
  const World both = make_world({{sheet, {}}}, {}, true);
  const Correspondences of_single = find_correspondences(*single.scene, cameras, 8);
  const Correspondences of_both = find_correspondences(*both.scene, cameras, 8);
  const size_t n = num_pixels(of_single), j = pixel_index(of_single, 0, 4, 4);
  EXPECT_FALSE(seen(of_single.landing[n + j]));
  EXPECT_TRUE(seen(of_both.landing[n + j]));
  // Both sides have the same texture. Pixel (4, 4) from behind is (3, 4) from the front.
  EXPECT_FALSE(seen(of_single.landing[2 * n + j]));
  ASSERT_TRUE(seen(of_both.landing[2 * n + j]));
  EXPECT_NEAR(of_both.landing[2 * n + j].x, 3.5f, 1e-3f);
  EXPECT_NEAR(of_both.landing[2 * n + j].y, 4.5f, 1e-3f);
}

TEST(BiasLevels, sizes_and_windows_follow_the_unet) {
  const World world = sphere_world(UvState::kClean, 16);
  const std::vector<render::Camera> cameras(9, render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 320, 192));
  int last = 0;
  Progress progress;
  progress.on_update = [&](std::string_view task, double done, double) {
    EXPECT_EQ(task, "correspond");
    last = static_cast<int>(done);
  };
  const auto levels = bias_levels(*world.scene, cameras, progress);
  ASSERT_EQ(levels.size(), 4u);
  EXPECT_EQ(last, 4);
  const std::array<int, 4> widths{40, 20, 10, 5}, heights{24, 12, 6, 3}, radii{4, 2, 1, 0};
  for (size_t level = 0; level < 4; ++level) {
    const attention::KeyBuckets& b = levels[level];
    EXPECT_EQ(b.grid, 3);
    EXPECT_EQ(b.view_width, widths[level]);
    EXPECT_EQ(b.view_height, heights[level]);
    EXPECT_EQ(b.window_radius, radii[level]);
    ASSERT_EQ(b.offsets.size(), static_cast<size_t>(b.num_pixels()) + 1);
    EXPECT_EQ(static_cast<size_t>(b.offsets.back()), b.keys.size());
    for (size_t cell = 0; cell + 1 < b.offsets.size(); ++cell)
      for (int32_t k = b.offsets[cell] + 1; k < b.offsets[cell + 1]; ++k)
        EXPECT_LT(b.keys[static_cast<size_t>(k) - 1], b.keys[static_cast<size_t>(k)]);
  }
}

TEST(BiasLevels, sizes_that_do_not_divide_are_rounded_up_like_strided_convolutions) {
  const World world = sphere_world(UvState::kClean, 16);
  const std::vector<render::Camera> cameras{render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 104, 72)};
  const auto levels = bias_levels(*world.scene, cameras);
  int width = 13, height = 9;
  for (const auto& level : levels) {
    EXPECT_EQ(level.view_width, width);
    EXPECT_EQ(level.view_height, height);
    width = (width + 1) / 2, height = (height + 1) / 2;  // kernel 3, stride 2, padding 1
  }
}

TEST(Correspondences, rejects_what_does_not_fit) {
  const World world = sphere_world(UvState::kClean, 8);
  const render::Camera camera = render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 64, 64);
  render::Camera other = camera;
  other.width = 32;
  EXPECT_THROW(find_correspondences(*world.scene, std::vector{camera, camera, camera}, 8), Error);
  EXPECT_THROW(find_correspondences(*world.scene, std::vector{camera, camera, camera, other}, 8), Error);
  EXPECT_THROW(find_correspondences(*world.scene, std::vector{camera}, 0), Error);
  EXPECT_THROW(bucket_keys(find_correspondences(*world.scene, std::vector{camera}, 8), -1), Error);
}

}  // namespace
}  // namespace patina::correspond
