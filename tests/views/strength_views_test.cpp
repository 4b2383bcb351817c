// Strength maps through a camera, against what a square in front of it must show.
#include "patina/views/strength_views.h"

#include <gtest/gtest.h>

#include "../render/scenes.h"

namespace patina::views {
namespace {

namespace scenes = render::test;

// A square of two metres that fills the middle half of a view of 64² pixels: 32 pixels across it.
struct World {
  std::vector<scenes::Part> parts{{scenes::quad(vec3(-1, -1, 0), vec3(2, 0, 0), vec3(0, 2, 0)), {}}};
  asset::Asset asset = scenes::make_asset(parts);
  render::Scene scene{asset, scenes::make_maps(parts), render::constant_environment(vec3(1.0f))};
  render::Camera camera = render::look_at(vec3(0, 0, 4), vec3(0.0f), 2 * std::atan(0.5f), 64, 64);

  Image view(Image texels) const {
    asset::Map map;
    map.texels = std::move(texels);
    return strength_views(scene, std::vector<render::Camera>{camera}, std::vector<asset::Map>{map})[0];
  }
};

TEST(StrengthViews, shows_each_texel_at_its_place_and_nothing_beside_the_asset) {
  const World world;
  Image texels(32, 32, 1);
  for (int y = 0; y < 32; ++y)
    for (int x = 16; x < 32; ++x) *texels.at(x, y) = 1.0f;
  const Image view = world.view(texels);
  for (int y = 18; y < 46; ++y)
    for (int x = 18; x < 46; ++x) EXPECT_NEAR(*view.at(x, y), x < 32 ? 0.0f : 1.0f, 0.26f) << x << ' ' << y;
  for (int y = 16; y < 48; ++y)
    for (int x = 0; x < 32; ++x) EXPECT_LE(*view.at(x, y), 0.0f) << "zero is exact";
  EXPECT_EQ(*view.at(5, 30), -1.0f);
  EXPECT_EQ(*view.at(60, 60), -1.0f);
}

// Texels far finer than pixels are averaged, not picked.
TEST(StrengthViews, fine_texels_become_their_mean) {
  const World world;
  Image texels(1024, 1024, 1);
  for (int y = 0; y < 1024; ++y)
    for (int x = 0; x < 1024; ++x) *texels.at(x, y) = (x + y) % 4 == 0 ? 1.0f : 0.0f;
  const Image view = world.view(texels);
  for (int y = 18; y < 46; ++y)
    for (int x = 18; x < 46; ++x) EXPECT_NEAR(*view.at(x, y), 0.25f, 0.02f) << x << ' ' << y;
}

TEST(StrengthViews, one_line_of_texels_is_seen) {
  const World world;
  Image texels(512, 512, 1);
  for (int y = 0; y < 512; ++y) *texels.at(255, y) = 1.0f;
  const Image view = world.view(texels);
  for (int y = 18; y < 46; ++y) EXPECT_GT(*view.at(31, y) + *view.at(32, y), 0.02f);
  for (int y = 18; y < 46; ++y) EXPECT_EQ(*view.at(25, y), 0.0f);
}

TEST(StrengthViews, a_constant_map_is_that_constant_on_all_of_the_asset) {
  const World world;
  const Image view = world.view(Image(1, 1, 1, 0.5f));
  for (const float value : view.pixels) EXPECT_TRUE(value == 0.5f || value == -1.0f) << value;
  EXPECT_EQ(*view.at(32, 32), 0.5f);
}

}  // namespace
}  // namespace patina::views
