// Points at which views are compared: where the views really show them.
#include "patina/pipeline/pick_point.h"

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/pipeline/workbench.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::pipeline {
namespace {

// G-buffers of the kettle in `num_views` views; nothing is rendered.
struct Kettle {
  Workbench bench;
  views::ViewSet views;

  explicit Kettle(int num_views) : bench(open(num_views)) {
    views.grid = views::grid_of(bench.cameras.size());
    for (const render::Camera& camera : bench.cameras)
      views.views.push_back({.camera = camera,
                             .gbuffer = views::make_gbuffer(*bench.scene, camera),
                             .radiance = {},
                             .coverage = {}});
  }
  static Workbench open(int num_views) {
    Config config;
    config.inputs.asset = test::small_kettle();
    config.inputs.orbit.num_views = num_views;
    config.inputs.orbit.resolution = 128;
    return open_workbench(config.inputs, {});
  }
};

TEST(PickPoint, views_that_are_said_to_see_a_point_show_it_there) {
  const Kettle kettle(9);
  const PickedPoint point = best_point(*kettle.bench.scene, kettle.views);
  EXPECT_EQ(point.view, 0);
  EXPECT_GE(point.num_good_views(), 3);  // 40° apart
  for (size_t v = 0; v < kettle.views.views.size(); ++v) {
    if (!point.sights[v] || point.sights[v]->cosine < kGoodCosine) continue;
    // The pixel's own surface lies within a pixel's stretch of the point.
    const views::GBuffer& gbuffer = kettle.views.views[v].gbuffer;
    const auto x = static_cast<size_t>(point.sights[v]->pixel.x),
               y = static_cast<size_t>(point.sights[v]->pixel.y);
    const size_t pixel = y * static_cast<size_t>(gbuffer.width) + x;
    const render::Camera& camera = kettle.views.views[v].camera;
    const float pixel_size = gbuffer.depth[pixel] / camera.focal_pixels();
    EXPECT_LT(glm::distance(gbuffer.p_world[pixel], point.p_world), 1.5f * pixel_size / kGoodCosine) << v;
  }
}

TEST(PickPoint, takes_the_pixel_or_the_view_that_is_asked_for) {
  const Kettle kettle(4);
  const PickedPoint at = point_at(*kettle.bench.scene, kettle.views, 1, 64, 70);
  EXPECT_EQ(at.view, 1);
  EXPECT_EQ(at.sights[1]->pixel, vec2(64.5f, 70.5f));
  EXPECT_EQ(best_point(*kettle.bench.scene, kettle.views, 3).view, 3);
  EXPECT_THROW(point_at(*kettle.bench.scene, kettle.views, 1, 0, 0), Error);
  EXPECT_THROW(point_at(*kettle.bench.scene, kettle.views, 4, 64, 64), Error);
  EXPECT_THROW(best_point(*kettle.bench.scene, kettle.views, -1), Error);
}

TEST(PickPoint, says_so_where_no_view_shows_the_asset) {
  Kettle kettle(4);
  for (views::View& view : kettle.views.views)
    std::fill(view.gbuffer.primitive.begin(), view.gbuffer.primitive.end(), -1);
  EXPECT_THROW(best_point(*kettle.bench.scene, kettle.views), Error);
}

}  // namespace
}  // namespace patina::pipeline
