// Control images: the tile view over its backdrop, and the colours of normalbae.
#include <gtest/gtest.h>

#include "../render/scenes.h"
#include "patina/image/color.h"
#include "patina/views/view_set.h"

namespace patina::views {
namespace {

namespace scenes = render::test;

View flat_view(int size, const vec3& radiance, float coverage) {
  View view;
  view.radiance = Image(size, size, 3);
  view.coverage = Image(size, size, 1, coverage);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) view.radiance.set_rgb(x, y, coverage * radiance);
  return view;
}

TEST(TileControl, full_pixels_are_the_tone_mapped_render) {
  const View view = flat_view(2, vec3(0.1f, 1.0f, 20.0f), 1.0f);
  const Image tile = tile_control(view, 1.5f), expected = tone_map(view.radiance, 1.5f);
  for (size_t i = 0; i < tile.pixels.size(); ++i) EXPECT_NEAR(tile.pixels[i], expected.pixels[i], 1e-6f);
}

TEST(TileControl, empty_pixels_are_the_backdrop) {
  for (const float value : tile_control(flat_view(2, vec3(5.0f), 0.0f), 0.0f).pixels)
    EXPECT_NEAR(value, kBackdropSrgb, 1e-6f);
}

TEST(TileControl, object_of_the_backdrops_colour_has_no_fringe_at_any_coverage) {
  const float backdrop = linear_from_srgb(kBackdropSrgb);
  const float radiance = backdrop / (1.0f - backdrop);  // Reinhard's tone map maps it to the backdrop
  for (float coverage = 0.0f; coverage <= 1.0f; coverage += 0.0625f) {
    const Image tile = tile_control(flat_view(1, vec3(radiance), coverage), 0.0f);
    EXPECT_NEAR(tile.pixels[0], kBackdropSrgb, 1e-5f) << coverage;
  }
}

TEST(TileControl, edges_lie_between_object_and_backdrop_even_for_bright_objects) {
  const float object = srgb_from_linear(reinhard(1000.0f));
  float last = kBackdropSrgb;
  for (float coverage = 0.125f; coverage <= 1.0f; coverage += 0.125f) {
    const float value = tile_control(flat_view(1, vec3(1000.0f), coverage), 0.0f).pixels[0];
    EXPECT_GT(value, last);
    EXPECT_LE(value, object + 1e-6f);
    last = value;
  }
}

TEST(NormalControl, front_is_blue_left_is_red_top_is_green_and_background_black) {
  const std::vector<scenes::Part> parts{{scenes::sphere(vec3(0.0f), 1.0f, 64), {}}};
  const asset::Asset asset = scenes::make_asset(parts);
  const render::Scene scene(asset, scenes::make_maps(parts), render::constant_environment(vec3(1.0f)));
  // From behind and above: the colours belong to the camera, not to the world.
  View view;
  view.camera = render::look_at(vec3(1.0f, 1.5f, -4.0f), vec3(0.0f), 0.6f, 65, 65);
  view.gbuffer = make_gbuffer(scene, view.camera);
  const Image image = normal_control(view);
  const vec3 middle = image.rgb(32, 32);
  EXPECT_NEAR(middle.x, 0.5f, 0.03f);
  EXPECT_NEAR(middle.y, 0.5f, 0.03f);
  EXPECT_NEAR(middle.z, 1.0f, 0.01f);
  EXPECT_EQ(image.rgb(0, 0), vec3(0.0f));
  const vec3 left = image.rgb(16, 32), right = image.rgb(48, 32), top = image.rgb(32, 16),
             bottom = image.rgb(32, 48);
  EXPECT_GT(left.x, 0.75f);
  EXPECT_LT(right.x, 0.25f);
  EXPECT_GT(top.y, 0.75f);
  EXPECT_LT(bottom.y, 0.25f);
}

}  // namespace
}  // namespace patina::views
