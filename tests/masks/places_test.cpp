// Masks made from the shape: what each place means on a box that stands on the ground, texel by texel.
#include "patina/masks/places.h"

#include <gtest/gtest.h>

#include "../render/scenes.h"

namespace patina::masks {
namespace {

namespace scenes = render::test;

constexpr int kSide = 64;

// A box of 2 × 2 × 2 metres: top (material 0), front (1), and the rest; a bowl's inside is a box turned in.
struct Box {
  std::vector<scenes::Part> parts;
  asset::Asset asset;
  render::Scene scene;
  explicit Box(bool turned_in = false)
      : parts(sides(turned_in)),
        asset(scenes::make_asset(parts)),
        scene(asset, scenes::make_maps(parts), render::constant_environment(vec3(1.0f))) {}

  static std::vector<scenes::Part> sides(bool turned_in) {
    const vec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2), low(-1, 0, -1);
    std::vector<scenes::Part> out{{scenes::quad(low + y + z, x, -z), {}},  // top
                                  {scenes::quad(low + z, x, y), {}},       // front
                                  {scenes::quad(low, x, z), {}},           // bottom
                                  {scenes::quad(low, y, x), {}},          {scenes::quad(low, z, y), {}},
                                  {scenes::quad(low + x, y, z), {}}};
    for (scenes::Part& part : out)
      if (turned_in)
        for (uvec3& t : part.primitive.triangles) std::swap(t.y, t.z);
    return out;
  }

  Image map(int material, std::vector<PlaceAmount> places) const {
    return place_strength(scene, asset::Map{}, kSide, kSide, material, places, {}).texels;
  }
};

TEST(Places, up_and_down_are_where_the_surface_faces) {
  const Box box;
  EXPECT_EQ(*box.map(0, {{Place::kUp, 1}}).at(30, 30), 1.0f);
  EXPECT_EQ(*box.map(0, {{Place::kDown, 1}}).at(30, 30), 0.0f);
  EXPECT_EQ(*box.map(2, {{Place::kDown, 1}}).at(30, 30), 1.0f);
  EXPECT_EQ(*box.map(1, {{Place::kUp, 1}}).at(30, 30), 0.0f);
}

TEST(Places, edges_are_a_band_along_the_border_of_a_face) {
  const Image edges = Box().map(1, {{Place::kEdges, 1}});
  for (int i = 0; i < kSide; ++i) {
    EXPECT_GT(*edges.at(i, 0), 0.8f);
    EXPECT_GT(*edges.at(0, i), 0.8f);
    if (i > 6 && i < 57) {
      EXPECT_EQ(*edges.at(i, 31), 0.0f) << i;
    }
  }
}

TEST(Places, a_room_has_crevices_in_its_corners_and_is_a_cavity_all_over) {
  const Box room(true);
  const Image crevices = room.map(1, {{Place::kCrevices, 1}}), edges = room.map(1, {{Place::kEdges, 1}}),
              cavities = room.map(1, {{Place::kCavities, 1}});
  EXPECT_GT(*crevices.at(31, 0), 0.8f);
  EXPECT_EQ(*crevices.at(31, 31), 0.0f);
  EXPECT_EQ(*edges.at(31, 0), 0.0f);
  EXPECT_GT(*cavities.at(1, 1), *cavities.at(31, 31));
}

TEST(Places, amounts_scale_and_the_strongest_of_several_counts) {
  const Box box;
  const Image edges = box.map(1, {{Place::kEdges, 1}}), half = box.map(1, {{Place::kEdges, 0.5f}}),
              crevices = box.map(1, {{Place::kCrevices, 1}}),
              both = box.map(1, {{Place::kEdges, 0.5f}, {Place::kCrevices, 1}});
  for (size_t i = 0; i < edges.pixels.size(); ++i) {
    EXPECT_EQ(half.pixels[i], 0.5f * edges.pixels[i]);
    EXPECT_EQ(both.pixels[i], std::max(half.pixels[i], crevices.pixels[i]));
  }
}

// Few rays a texel are noisy; a mask must not be.
TEST(Places, edges_are_smooth_along_the_border) {
  const Image edges = Box().map(1, {{Place::kEdges, 1}});
  for (int i = 8; i < kSide - 9; ++i) EXPECT_NEAR(*edges.at(i, 1), *edges.at(i + 1, 1), 0.2f) << i;
}

// Streaks begin at the upper rim of the front and fade on their way down; there are some, and gaps between.
TEST(Places, drips_run_down_from_the_upper_rim) {
  const Box box;
  const Image drips = box.map(1, {{Place::kDrips, 1}});
  const asset::Primitive& front = box.parts[1].primitive;
  const bool v_points_up = front.uv[0][3].y > front.uv[0][0].y;  // corner 3 lies above corner 0
  int streaks = 0, gaps = 0;
  for (int x = 2; x < kSide - 2; ++x) {
    float above = 2.0f;
    for (int k = 2; k < kSide; ++k) {
      const float value = *drips.at(x, v_points_up ? kSide - 1 - k : k);
      EXPECT_LE(value, above + 0.03f) << x << ' ' << k;
      above = value;
    }
    EXPECT_EQ(above, 0.0f) << "a streak is shorter than the box";
    (*drips.at(x, v_points_up ? kSide - 3 : 2) > 0.2f ? streaks : gaps)++;
  }
  EXPECT_GT(streaks, 3);
  EXPECT_GT(gaps, 3);
  const Image top = box.map(0, {{Place::kDrips, 1}});
  for (const float value : top.pixels) EXPECT_EQ(value, 0.0f);
}

}  // namespace
}  // namespace patina::masks
