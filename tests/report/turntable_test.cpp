#include <cmath>

#include <gtest/gtest.h>

#include "../support.h"
#include "patina/asset/material_maps.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/report/report.h"
#include "webp_decoding.h"

namespace patina::report {
namespace {

// A square metre in the plane z = 3, facing both ways, around (2, 0, 3): not around the world's origin.
asset::Asset square_asset() {
  asset::Asset out;
  asset::Primitive square;
  for (const auto& [x, y] : {std::pair{-0.5f, -0.5f}, {0.5f, -0.5f}, {0.5f, 0.5f}, {-0.5f, 0.5f}}) {
    square.p_world.emplace_back(2 + x, y, 3);
    square.n_world.emplace_back(0, 0, 1);
    square.tangent_world.emplace_back(1, 0, 0, 1);
  }
  square.uv = {{{0, 1}, {1, 1}, {1, 0}, {0, 0}}};
  square.triangles = {{0, 1, 2}, {0, 2, 3}};
  out.primitives = {square};
  out.materials.resize(1);
  out.materials[0].double_sided = true;
  out.materials[0].metallic_factor = 0;
  return out;
}

render::Scene scene_of(const asset::Asset& square, const vec3& color) {
  auto maps = asset::resolve_materials(square);
  maps[0].base_color.texels = Image(1, 1, 3);
  maps[0].base_color.texels.set_rgb(0, 0, color);
  return render::Scene(square, std::move(maps), render::constant_environment(vec3(1.0f)));
}

// Pixels of the columns [begin, end) that differ clearly from the backdrop's middle grey.
int num_object_pixels(const Image& frame, int begin, int end) {
  int count = 0;
  for (int y = 0; y < frame.height; ++y)
    for (int x = begin; x < end; ++x) count += glm::length(frame.rgb(x, y) - vec3(0.5f)) > 0.15f;
  return count;
}

TEST(Turntable, goes_once_around_the_asset_with_before_left_and_after_right) {
  const test::TemporaryFolder folder;
  const asset::Asset square = square_asset();
  const render::Scene before = scene_of(square, vec3(0.02f)), after = scene_of(square, {0.9f, 0.02f, 0.02f});
  const render::Camera camera = render::look_at({2, 0, 6}, {2, 0, 3}, 0.6f, 64, 64);
  TurntableOptions options;
  options.frames = 4;
  options.resolution = 48;
  options.samples_per_pixel = 8;
  options.seconds = 1;
  int updates = 0;
  Progress progress;
  progress.on_update = [&](std::string_view, double, double total) { updates += total == 4; };
  write_turntable(folder.path() / "turntable.webp", before, after, std::span(&camera, 1), options, progress);

  const auto decoded = test::decode_animation(read_file(folder.path() / "turntable.webp"));
  ASSERT_EQ(decoded.frames.size(), 4u);
  EXPECT_EQ(updates, 4);
  EXPECT_EQ(decoded.end_milliseconds.back(), 1000);
  for (const Image& frame : decoded.frames) {
    ASSERT_EQ(frame.width, 96);
    ASSERT_EQ(frame.height, 48);
  }
  for (const size_t facing : {0u, 2u}) {
    const vec3 left = decoded.frames[facing].rgb(24, 24), right = decoded.frames[facing].rgb(72, 24);
    EXPECT_LT(max_component(left), 0.4f) << "black before, frame " << facing;
    EXPECT_GT(right.x - right.y, 0.3f) << "red after, frame " << facing;
    EXPECT_GT(num_object_pixels(decoded.frames[facing], 0, 48), 300);
  }
  for (const size_t edge_on : {1u, 3u})
    EXPECT_LT(num_object_pixels(decoded.frames[edge_on], 0, 48), 100)
        << "a quarter turn shows the square's edge";
}

TEST(Turntable, stops_when_asked_and_writes_nothing) {
  const test::TemporaryFolder folder;
  const asset::Asset square = square_asset();
  const render::Scene scene = scene_of(square, vec3(0.5f));
  const render::Camera camera = render::look_at({2, 0, 6}, {2, 0, 3}, 0.6f, 64, 64);
  Progress progress;
  progress.stop_requested = [] { return true; };
  EXPECT_THROW(write_turntable(folder.path() / "t.webp", scene, scene, std::span(&camera, 1), {}, progress),
               Error);
  EXPECT_THROW(write_turntable(folder.path() / "t.webp", scene, scene, {}, {}, {}), Error);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "t.webp"));
}

}  // namespace
}  // namespace patina::report
