// What a fit learns before its first step: what was edited, how far its light can be trusted, what is still a
// metal.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "patina/image/color.h"
#include "patina/inverse/edited_pixels.h"
#include "patina/inverse/fit.h"
#include "patina/inverse/fit_views.h"
#include "patina/inverse/loss.h"
#include "patina/render/path_tracer.h"
#include "patina/views/view_set.h"
#include "support.h"
#include "worlds.h"

namespace patina::test {
namespace {

TEST(fit, a_view_that_was_not_edited_changes_nothing) {
  Task task = make_task();
  const auto start = task.world.scene.materials();
  render::PathOptions path;
  path.samples_per_pixel = 8;  // noise is no edit either
  task.edited = {tone_map(render::render(task.world.scene, task.world.camera, path).radiance, 0.0f)};
  const auto largest_change = [&](std::span<const Image> clean) {
    const auto result = inverse::fit_materials(
        task.world.scene, {.views = task.views, .edited = task.edited, .clean = clean}, quick(), {}, {});
    float largest = 0;
    for (size_t m = 0; m < result.maps.size(); ++m)
      for (const asset::MapSlotRow& row : asset::kMapSlots) {
        const asset::Map& map = asset::slot_map(result.maps[m], row.slot);
        const Image before =
            asset::resized(asset::slot_map(start[m], row.slot), map.texels.width, map.texels.height).texels;
        for (size_t i = 0; i < before.pixels.size(); ++i)
          largest = std::max(largest, std::abs(map.texels.pixels[i] - before.pixels[i]));
      }
    return largest;
  };
  const float with_clean = largest_change(task.edited), without = largest_change({});
  EXPECT_LT(with_clean, 1e-6f);  // normals are scaled to length one
  EXPECT_GT(without, 0.08f);     // which the errors of the light cache would do
}

TEST(fit, counts_pixels_less_that_the_light_cache_shows_wrongly) {
  Task task = make_task();
  const Image& edited = task.edited[0];
  inverse::LightCache cache;
  cache.pixels = inverse::select_pixels(task.views, {{inverse::loss_target(edited)}},
                                        {{Image(edited.width, edited.height, 1, 1.0f)}});
  // One sample a pixel: right, a twentieth off, far off, and so on.
  constexpr float kErrors[] = {0.0f, 0.05f, 0.5f}, kWeights[] = {1.0f, 0.5f, 0.0f};
  std::vector<vec3> of_samples;
  cache.first_sample.push_back(0);
  for (size_t i = 0; i < cache.pixels.size(); ++i) {
    const vec3 wrong = cache.pixels[i].target * (1.0f - kErrors[i % 3]);
    of_samples.push_back(wrong / (1.0f - wrong));
    cache.samples.emplace_back().pixel = static_cast<uint32_t>(i);
    cache.first_sample.push_back(static_cast<uint32_t>(i + 1));
  }
  inverse::calibrate(cache, of_samples, task.edited, 1.0f);
  int num_lit = 0;
  for (size_t i = 0; i < cache.pixels.size(); ++i) {
    if (max_component(cache.pixels[i].target) < 0.2f) continue;  // of dark pixels, errors count less
    EXPECT_NEAR(cache.pixels[i].weight, kWeights[i % 3], 0.15f);
    ++num_lit;
  }
  EXPECT_GT(num_lit, 100);
}

TEST(fit, knows_which_half_of_a_view_was_edited) {
  Task task = make_task();
  const std::vector<Image> clean = task.edited;
  Image& edited = task.edited[0];
  const int middle = edited.width / 2;
  for (int y = 0; y < edited.height; ++y)
    for (int x = 0; x < middle; ++x) edited.set_rgb(x, y, 0.8f * edited.rgb(x, y));
  inverse::LightCache cache;
  cache.pixels = inverse::select_pixels(task.views, {{inverse::loss_target(edited)}},
                                        {{Image(edited.width, edited.height, 1, 1.0f)}});
  const std::vector<float> shares = inverse::edited_pixels(cache, task.views, clean);
  int num_edited = 0, num_kept = 0;
  for (size_t i = 0; i < shares.size(); ++i) {
    const int x = cache.pixels[i].x;
    if (x >= middle - 1 && x <= middle) continue;  // sees the other half as well
    const vec3 before = clean[0].rgb(x, cache.pixels[i].y);
    if (x > middle) {
      EXPECT_EQ(shares[i], 0.0f);
      ++num_kept;
    } else if (max_component(before) > 0.1f) {
      EXPECT_EQ(shares[i], 1.0f);
      ++num_edited;
    }
  }
  EXPECT_GT(num_edited, 100);
  EXPECT_GT(num_kept, 100);
}

// Share of the seen texels that a fit from metal of roughness 0.3 makes a metal, where the truth has these
// values and the world's own textures.
double share_of_metal(float true_metallic, float true_roughness) {
  World world = make_world(Lighting::kStudio, 8, 64);
  const auto set = [&](float metallic, float roughness) {
    for (auto& maps : world.maps) {
      maps.metallic.texels = Image(1, 1, 1, metallic);
      maps.roughness.texels = Image(1, 1, 1, roughness);
    }
    world.scene.set_asset_materials(world.maps);
  };
  std::vector<render::Camera> cameras;
  for (const vec3 eye :
       {vec3(0.6f, 1.4f, 3.0f), vec3(-2.0f, 1.4f, 2.2f), vec3(2.0f, 1.0f, 2.2f), vec3(0.0f, 3.0f, 1.5f)})
    cameras.push_back(render::look_at(eye, vec3(0.0f, 0.5f, 0.0f), 0.7f, 64, 64));
  const auto rendered = [&] {
    views::ViewOptions options;
    options.path.samples_per_pixel = 64;
    options.exposure_ev = 0.0f;
    return views::render_views(world.scene, cameras, options, {});
  };
  const auto pictures = [](const views::ViewSet& views) {
    std::vector<Image> shown;
    for (const views::View& view : views.views) shown.push_back(tone_map(view.radiance, views.exposure_ev));
    return shown;
  };
  set(true_metallic, true_roughness);
  const std::vector<Image> edited = pictures(rendered());
  for (auto& maps : world.maps) maps.base_color.texels = Image(8, 8, 3, 0.7f);
  set(1.0f, 0.3f);
  const views::ViewSet views = rendered();
  const std::vector<Image> clean = pictures(views);
  const auto result = inverse::fit_materials(world.scene, {.views = views, .edited = edited, .clean = clean},
                                             quick(), {}, {});
  double seen = 0, metal = 0;
  for (size_t m = 0; m < 2; ++m) {
    const Image metallic = asset::resized(result.maps[m].metallic, 8, 8).texels;
    for (size_t i = 0; i < metallic.pixels.size(); ++i) {
      const bool is_seen = result.evidence[m].pixels[i] >= 1.0f;
      seen += is_seen, metal += is_seen && metallic.pixels[i] > 0.5f;
    }
  }
  EXPECT_GT(seen, 50);
  return metal / seen;
}

TEST(fit, finds_that_a_metal_became_none_and_that_another_stayed_one) {
  EXPECT_LT(share_of_metal(0.0f, 0.9f), 0.05);
  EXPECT_GT(share_of_metal(1.0f, 0.3f), 0.9);
}

}  // namespace
}  // namespace patina::test
