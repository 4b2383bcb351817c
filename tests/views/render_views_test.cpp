// Rendering all views: one exposure, progress over all of them, stopping, repeatability.
#include <gtest/gtest.h>

#include "../render/scenes.h"
#include "patina/base/error.h"
#include "patina/image/color.h"
#include "patina/views/view_set.h"

namespace patina::views {
namespace {

namespace scenes = render::test;

class RenderViews : public testing::Test {
 protected:
  RenderViews() : parts_{{scenes::sphere(vec3(0.0f), 1.0f, 32), {}}}, asset_(scenes::make_asset(parts_)) {}

  render::Scene scene(float light) const {
    return render::Scene(asset_, scenes::make_maps(parts_), render::constant_environment(vec3(light)));
  }
  std::vector<render::Camera> cameras(int resolution = 32) const {
    OrbitOptions options;
    options.num_views = 4;
    options.resolution = resolution;
    return orbit_cameras(asset::bounds(asset_), options);
  }
  static ViewOptions quick() {
    ViewOptions options;
    options.path.samples_per_pixel = 8;
    return options;
  }

  std::vector<scenes::Part> parts_;
  asset::Asset asset_;
};

TEST_F(RenderViews, exposure_lays_a_grey_card_onto_middle_grey) {
  // Under even light an object sends back its reflectance of it: one of 0.18 lands at 0.18, whatever the
  // light.
  for (const float base : {0.0625f, 0.18f, 0.8f}) {
    std::vector<scenes::Part> parts = parts_;
    std::vector<asset::MaterialMaps> maps = scenes::make_maps(parts);
    for (asset::MaterialMaps& map : maps)
      std::fill(map.base_color.texels.pixels.begin(), map.base_color.texels.pixels.end(), base);
    const render::Scene lit(asset_, std::move(maps), render::constant_environment(vec3(3.0f)));
    ViewOptions options = quick();
    options.path.samples_per_pixel = 64;  // noise lowers the mean of logarithms
    const ViewSet views = render_views(lit, cameras(), options, {});
    EXPECT_EQ(views.grid, 2);
    ASSERT_EQ(views.views.size(), 4u);
    const float reflectance = 0.025f + 0.975f * base;
    double sum = 0;
    int count = 0;
    for (const View& view : views.views)
      for (size_t i = 0; i < view.gbuffer.coverage.size(); ++i)
        if (view.gbuffer.coverage[i] == 1.0f) {
          EXPECT_NEAR(view.gbuffer.reflectance[i], reflectance, 1e-5f);
          const float* rgb = &view.radiance.pixels[3 * i];
          sum += std::log(luminance(vec3(rgb[0], rgb[1], rgb[2])));
          ++count;
        }
    const auto log_average = static_cast<float>(std::exp(sum / count));
    const float card = std::exp2(views.exposure_ev) * log_average * 0.18f / reflectance;
    EXPECT_NEAR(reinhard(card), 0.18f, 0.002f);
    // A matt object in even light is as bright as its reflectance says, about.
    EXPECT_NEAR(log_average / 3.0f / reflectance, 1.0f, 0.15f) << base;
  }
}

TEST_F(RenderViews, exposure_leaves_out_pixels_whose_centre_meets_nothing) {
  ViewSet views = render_views(scene(1.0f), cameras(), quick(), {});
  GBuffer& g = views.views[0].gbuffer;
  const auto full = std::find(g.coverage.begin(), g.coverage.end(), 1.0f);
  ASSERT_NE(full, g.coverage.end());
  g.reflectance[static_cast<size_t>(full - g.coverage.begin())] = 0.0f;
  EXPECT_NEAR(choose_exposure(views.views), views.exposure_ev, 0.01f);
}

TEST_F(RenderViews, exposure_follows_the_unit_of_light) {
  const float one = render_views(scene(1.0f), cameras(), quick(), {}).exposure_ev;
  const float eight = render_views(scene(8.0f), cameras(), quick(), {}).exposure_ev;
  EXPECT_NEAR(one - eight, 3.0f, 1e-3f);
}

TEST_F(RenderViews, black_objects_keep_exposure_zero_and_given_exposure_is_kept) {
  EXPECT_EQ(render_views(scene(0.0f), cameras(), quick(), {}).exposure_ev, 0.0f);
  ViewOptions options = quick();
  options.exposure_ev = -1.25f;
  EXPECT_EQ(render_views(scene(1.0f), cameras(), options, {}).exposure_ev, -1.25f);
}

TEST_F(RenderViews, environment_stays_out_of_camera_rays) {
  ViewOptions options = quick();
  options.path.show_environment = true;
  const ViewSet views = render_views(scene(1.0f), cameras(), options, {});
  EXPECT_EQ(views.views[0].radiance.rgb(0, 0), vec3(0.0f));
  EXPECT_EQ(*views.views[0].coverage.at(0, 0), 0.0f);
  EXPECT_EQ(*views.views[0].coverage.at(16, 16), 1.0f);
}

TEST_F(RenderViews, progress_rises_to_the_number_of_views_under_one_task) {
  double last = 0;
  Progress progress;
  progress.on_update = [&](std::string_view task, double done, double total) {
    EXPECT_EQ(task, "render");
    EXPECT_EQ(total, 4.0);
    EXPECT_GE(done, last);
    EXPECT_LE(done, total);
    last = done;
  };
  render_views(scene(1.0f), cameras(), quick(), progress);
  EXPECT_EQ(last, 4.0);
}

TEST_F(RenderViews, stops_when_asked) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  try {
    render_views(scene(1.0f), cameras(), quick(), progress);
    FAIL() << "was not interrupted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInterrupted);
  }
}

TEST_F(RenderViews, equal_seeds_repeat_and_views_do_not_share_noise) {
  ViewOptions options = quick();
  const auto first = render_views(scene(1.0f), cameras(), options, {});
  const auto again = render_views(scene(1.0f), cameras(), options, {});
  options.path.seed = 77;
  const auto other = render_views(scene(1.0f), cameras(), options, {});
  EXPECT_EQ(first.views[2].radiance.pixels, again.views[2].radiance.pixels);
  EXPECT_NE(first.views[2].radiance.pixels, other.views[2].radiance.pixels);
}

TEST_F(RenderViews, rejects_a_number_of_views_that_is_no_square) {
  auto three = cameras();
  three.pop_back();
  EXPECT_THROW(render_views(scene(1.0f), three, quick(), {}), Error);
}

}  // namespace
}  // namespace patina::views
