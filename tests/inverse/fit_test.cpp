// The fit as a whole: what it finds, what it leaves alone, that it repeats, resumes and stops; and the parts
// it is made of.
#include <atomic>
#include <cmath>
#include <functional>
#include <optional>

#include <gtest/gtest.h>

#include "patina/asset/texel_raster.h"
#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/base/random.h"
#include "patina/image/color.h"
#include "patina/inverse/fit.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/unseen.h"
#include "recovery/recovery.h"
#include "support.h"
#include "worlds.h"

namespace patina::test {
namespace {

std::vector<float> all_texels(const inverse::FitResult& result) {
  std::vector<float> values;
  for (const auto& maps : result.maps)
    for (const asset::MapSlotRow& row : asset::kMapSlots) {
      const auto& pixels = asset::slot_map(maps, row.slot).texels.pixels;
      values.insert(values.end(), pixels.begin(), pixels.end());
    }
  return values;
}

double base_color_error(const std::vector<asset::MaterialMaps>& maps, const Task& task,
                        const inverse::FitResult& result) {
  double error = 0, weight = 0;
  for (size_t m = 0; m < 2; ++m)
    for (size_t i = 0; i < result.evidence[m].pixels.size(); ++i) {
      if (result.evidence[m].pixels[i] < 1.0f) continue;
      for (size_t c = 0; c < 3; ++c) {
        error += std::abs(maps[m].base_color.texels.pixels[3 * i + c] -
                          task.world.maps[m].base_color.texels.pixels[3 * i + c]);
        weight += 1;
      }
    }
  return error / weight;
}

// A fit that is long enough to find the textures, and the errors of the base colours that it began and ended
// with.
struct Found {
  inverse::FitResult result;
  double before, after;
};
constexpr int kEnoughIterations = 24;
// One view cannot tell a dark dielectric from a metal.
const asset::MapSet kMapsOfOneView =
    asset::set_of({asset::MapSlot::kBaseColor, asset::MapSlot::kRoughness, asset::MapSlot::kNormal});
Found find_textures(Task& task) {
  const auto start = task.world.scene.materials();
  inverse::FitOptions options = quick();
  options.iterations = kEnoughIterations;
  options.maps = kMapsOfOneView;
  auto result = inverse::fit_materials(task.world.scene, {task.views, task.edited}, options, {}, {});
  const double before = base_color_error(start, task, result),
               after = base_color_error(result.maps, task, result);
  return {std::move(result), before, after};
}

TEST(fit, finds_base_colour_from_one_view) {
  Task task = make_task(64);
  const auto [result, before, after] = find_textures(task);
  // Colour and roughness of these textures have nothing to do with each other, so what the fit knows of kinds
  // of material misleads it.
  EXPECT_LT(after, 0.65 * before) << before << " -> " << after;
  EXPECT_GT(result.psnr, 25.0f);

  // The maps that were written look, path-traced, as the fit believed: what it shades is what it returns.
  task.world.scene.set_asset_materials(result.maps);
  render::PathOptions path;
  path.samples_per_pixel = 64;
  const Image rendered = tone_map(render::render(task.world.scene, task.world.camera, path).radiance, 0.0f);
  const Image weight =
      inverse::loss_weight(task.views.views[0].gbuffer, {true, true}, quick().boundary_pixels);
  double error = 0, count = 0;
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) {
      if (*weight.at(x, y) <= 0.0f) continue;
      const vec3 d = rendered.rgb(x, y) - task.edited[0].rgb(x, y);
      error += glm::dot(d, d) / 3.0f, count += 1;
    }
  EXPECT_GT(-10.0 * std::log10(error / count), result.psnr - 2.0f);
  ASSERT_EQ(static_cast<int>(result.loss.size()), kEnoughIterations);
  EXPECT_TRUE(result.changed[0] == kMapsOfOneView);
}

TEST(fit, finds_textures_that_lie_on_the_surface_twice_each_way_or_once) {
  for (const auto wrap : {asset::Wrap::kRepeat, asset::Wrap::kMirroredRepeat, asset::Wrap::kClampToEdge}) {
    Task task = make_task(64, [&](asset::Map& map) {
      map.uv_transform = mat3(2, 0, 0, 0, 2, 0, -0.3f, -0.4f, 1);
      map.wrap_s = map.wrap_t = wrap;
    });
    const auto [result, before, after] = find_textures(task);
    EXPECT_LT(after, 0.6 * before) << "wrap " << static_cast<int>(wrap) << ": " << before << " -> " << after;
    EXPECT_EQ(result.maps[0].base_color.uv_transform, task.world.maps[0].base_color.uv_transform);
  }
}

TEST(fit, continues_from_a_checkpoint_made_before_the_first_iteration) {
  Task whole = make_task();
  const inverse::FitOptions options = quick();
  const auto expected =
      all_texels(inverse::fit_materials(whole.world.scene, {whole.views, whole.edited}, options, {}, {}));
  Task task = make_task();
  const Progress progress;
  inverse::Fit fit(task.world.scene, {task.views, task.edited}, options, progress);
  inverse::FitHooks hooks;
  hooks.resume = fit.checkpoint();
  const auto result = inverse::fit_materials(task.world.scene, {task.views, task.edited}, options, hooks, {});
  EXPECT_TRUE(all_texels(result) == expected);
}

TEST(fit, is_the_same_for_any_number_of_threads) {
  std::vector<std::vector<float>> results;
  for (const int threads : {1, 2}) {
    set_num_threads(threads);
    Task task = make_task();
    results.push_back(
        all_texels(inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), {}, {})));
  }
  set_num_threads(0);
  EXPECT_TRUE(results[0] == results[1]);
}

TEST(fit, resumed_run_gives_the_same_bytes) {
  Task whole = make_task();
  const auto expected =
      all_texels(inverse::fit_materials(whole.world.scene, {whole.views, whole.edited}, quick(), {}, {}));

  // Killed in the middle of a light cache's life, with the checkpoint of that iteration at hand.
  for (const int stop_at : {3, 7}) {
    Task task = make_task();
    std::optional<inverse::FitCheckpoint> saved;
    inverse::FitHooks hooks;
    hooks.every_iterations = 1;
    hooks.on_checkpoint = [&](const inverse::FitCheckpoint& checkpoint) {
      if (checkpoint.next_iteration == stop_at) saved = checkpoint;
    };
    Progress progress;
    progress.stop_requested = [&] { return saved.has_value(); };
    EXPECT_THROW(
        inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), hooks, progress), Error);
    ASSERT_TRUE(saved.has_value());

    Task again = make_task();
    hooks = {};
    hooks.resume = saved;
    const auto result =
        inverse::fit_materials(again.world.scene, {again.views, again.edited}, quick(), hooks, {});
    EXPECT_TRUE(all_texels(result) == expected) << "stopped at " << stop_at;
  }
}

TEST(fit, stopped_at_any_moment_hands_over_its_textures_and_continues_bit_for_bit) {
  Task whole = make_task();
  const auto expected =
      all_texels(inverse::fit_materials(whole.world.scene, {whole.views, whole.edited}, quick(), {}, {}));
  // Most of the questions are asked while rays are cast.
  std::atomic<int> num_asked = 0;
  Progress counting;
  counting.stop_requested = [&] { return ++num_asked < 0; };
  Task counted = make_task();
  inverse::fit_materials(counted.world.scene, {counted.views, counted.edited}, quick(), {}, counting);
  const int all = num_asked;
  for (const double share : {0.6, 0.75, 0.9}) {
    Task task = make_task();
    std::optional<inverse::FitCheckpoint> saved;
    std::optional<inverse::FitResult> left;
    inverse::FitHooks hooks;
    hooks.on_checkpoint = [&](const inverse::FitCheckpoint& checkpoint) { saved = checkpoint; };
    hooks.on_stop = [&](const inverse::FitResult& so_far) { left = so_far; };
    num_asked = 0;
    Progress progress;
    progress.stop_requested = [&] { return ++num_asked > share * all; };
    EXPECT_THROW(
        inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), hooks, progress), Error);
    ASSERT_TRUE(saved.has_value() && left.has_value());
    EXPECT_GT(saved->next_iteration, 0);
    EXPECT_LT(saved->next_iteration, quick().iterations);
    EXPECT_EQ(left->loss.size(), static_cast<size_t>(saved->next_iteration));
    EXPECT_FALSE(all_texels(*left) == expected);

    Task again = make_task();
    hooks = {};
    hooks.resume = saved;
    const auto result =
        inverse::fit_materials(again.world.scene, {again.views, again.edited}, quick(), hooks, {});
    EXPECT_TRUE(all_texels(result) == expected) << "stopped at " << saved->next_iteration;
  }
}

TEST(fit, shows_every_view_and_the_loss_at_the_end) {
  Task task = make_task();
  inverse::FitHooks hooks;
  size_t num_losses = 0;
  std::vector<Image> rendered;
  hooks.on_preview = [&](const inverse::FitPreview& preview) {
    num_losses = preview.loss.size();
    rendered.assign(preview.rendered.begin(), preview.rendered.end());
  };
  const auto result = inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), hooks, {});
  EXPECT_EQ(num_losses, result.loss.size());
  ASSERT_EQ(rendered.size(), task.edited.size());
  // What is shown comes near to what was asked for, where anything is shown.
  double error = 0, start_error = 0, count = 0;
  for (size_t v = 0; v < rendered.size(); ++v)
    for (int y = 0; y < rendered[v].height; ++y)
      for (int x = 0; x < rendered[v].width; ++x) {
        const vec3 shown = rendered[v].rgb(x, y), wanted = task.edited[v].rgb(x, y);
        if (shown == vec3(0.0f)) continue;
        error += glm::dot(shown - wanted, shown - wanted), count += 1;
        start_error += glm::dot(wanted, wanted);
      }
  ASSERT_GT(count, 0);
  EXPECT_LT(error, 0.1 * start_error);
}

TEST(fit, refuses_a_checkpoint_of_other_textures) {
  Task task = make_task();
  inverse::FitHooks hooks;
  hooks.resume = inverse::FitCheckpoint{3, std::vector<uint8_t>(100)};
  EXPECT_THROW(inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), hooks, {}),
               Error);
}

TEST(fit, changes_only_the_chosen_materials_and_maps) {
  Task task = make_task();
  const auto start = task.world.scene.materials();
  inverse::FitOptions options = quick();
  options.maps.set(index_of(asset::MapSlot::kNormal), false);
  const auto result =
      inverse::fit_materials(task.world.scene, {task.views, task.edited, {true, false}}, options, {}, {});
  EXPECT_NE(result.maps[0].base_color.texels.pixels, start[0].base_color.texels.pixels);
  EXPECT_EQ(result.maps[0].normal.texels.pixels, start[0].normal.texels.pixels);
  EXPECT_EQ(result.maps[1].base_color.texels.pixels, start[1].base_color.texels.pixels);
  EXPECT_FALSE(result.changed[1].any());
}

TEST(fit, leaves_surface_that_no_view_saw_as_it_was) {
  Task task = make_task();
  // Masks hide the left half of the picture.
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 20; ++x) task.views.views[0].gbuffer.material[static_cast<size_t>(y * 40 + x)] = -1;
  const auto start = task.world.scene.materials();
  inverse::FitOptions options = quick();
  options.texture_size = 32;
  options.fill_unseen = false;
  const auto result = inverse::fit_materials(task.world.scene, {task.views, task.edited}, options, {}, {});
  const asset::Map before = asset::resized(start[0].base_color, 32, 32);
  // The floor's u runs from left to right: its left third is hidden, with a margin for the rim of bilinear
  // look-ups.
  size_t moved_right = 0;
  for (int y = 8; y < 24; ++y)
    for (int x = 3; x < 32; ++x) {
      const bool same = result.maps[0].base_color.texels.rgb(x, y) == before.texels.rgb(x, y);
      if (x < 8) {
        EXPECT_TRUE(same) << x << " " << y;
      }
      if (x > 20 && !same) ++moved_right;
    }
  EXPECT_GT(moved_right, 100u);
}

TEST(fit, fills_surface_that_no_view_saw_with_the_change_beside_it_if_asked) {
  std::vector<asset::MaterialMaps> before;
  const auto fitted = [&](bool fill) {
    Task task = make_task();
    // The floor's u runs from left to right: its left third is hidden.
    for (int y = 0; y < 40; ++y)
      for (int x = 0; x < 20; ++x) task.views.views[0].gbuffer.material[static_cast<size_t>(y * 40 + x)] = -1;
    before = task.world.scene.materials();
    inverse::FitOptions options = quick();
    options.texture_size = 32;
    options.fill_unseen = fill;
    return inverse::fit_materials(task.world.scene, {task.views, task.edited}, options, {}, {});
  };
  const inverse::FitResult result = fitted(true);
  const asset::MaterialMaps filled = result.maps[0], kept = fitted(false).maps[0];
  const auto mean_change = [&](const asset::MaterialMaps& maps, asset::MapSlot slot, int from, int to) {
    const Image start = asset::resized(asset::slot_map(before[0], slot), 32, 32).texels;
    const Image& end = asset::slot_map(maps, slot).texels;
    double sum = 0;
    for (int y = 8; y < 24; ++y)
      for (int x = from; x < to; ++x) sum += *end.at(x, y) - *start.at(x, y);
    return sum / (16 * (to - from));
  };
  for (const auto slot : {asset::MapSlot::kBaseColor, asset::MapSlot::kRoughness}) {
    const double seen = mean_change(filled, slot, 20, 30);
    EXPECT_GT(std::abs(seen), 0.003) << "the edit changes nothing here";
    for (size_t i = 0; i < result.evidence[0].pixels.size(); ++i) {
      if (result.evidence[0].pixels[i] < 0.5f) continue;
      const auto channels = static_cast<size_t>(asset::row_of(slot).channels);
      EXPECT_EQ(asset::slot_map(filled, slot).texels.pixels[channels * i],
                asset::slot_map(kept, slot).texels.pixels[channels * i])
          << "what is seen stays";
    }
    EXPECT_EQ(mean_change(kept, slot, 3, 8), 0.0);
    EXPECT_GT(mean_change(filled, slot, 3, 8) / seen, 0.2);
    EXPECT_LT(mean_change(filled, slot, 3, 8) / seen, 5.0);
  }
  EXPECT_EQ(filled.normal.texels.pixels, kept.normal.texels.pixels);
}

// A row of texels a centimetre apart.
inverse::SurfaceTexels row_of_texels(int count) {
  inverse::SurfaceTexels surface{Image(count, 1, 1), {}};
  for (int i = 0; i < count; ++i) {
    surface.covered.pixels[static_cast<size_t>(i)] = 1.0f;
    surface.p_world.emplace_back(0.01f * static_cast<float>(i), 0.3f, -2.0f);
  }
  return surface;
}

TEST(unseen, gets_the_change_of_what_is_near_and_never_more) {
  constexpr int kCount = 256, kSeen = 128;
  inverse::SurfaceTexels surface = row_of_texels(kCount);
  surface.covered.pixels[200] = 0.0f;
  Image change(kCount, 1, 2), evidence(kCount, 1, 1);
  for (int i = 0; i < kSeen; ++i) {
    change.at(i, 0)[0] = i < 100 ? -1.0f : 0.5f;
    change.at(i, 0)[1] = 3.0f;
    *evidence.at(i, 0) = 1.0f;
  }
  change.at(200, 0)[0] = 7.0f;
  const Image out = inverse::spread_to_unseen(change, evidence, surface);
  for (int i = 0; i < kCount; ++i) {
    if (i < kSeen || i == 200) {
      EXPECT_EQ(out.at(i, 0)[0], change.at(i, 0)[0]) << i;
      continue;
    }
    EXPECT_GE(out.at(i, 0)[0], -1.0f) << i;
    EXPECT_LE(out.at(i, 0)[0], 0.5f) << i;
    EXPECT_NEAR(out.at(i, 0)[1], 3.0f, 1e-4f) << i;
  }
  EXPECT_GT(out.at(kSeen, 0)[0], 0.2f) << "beside the last seen ones";
  EXPECT_LT(out.at(kCount - 1, 0)[0], 0.0f) << "far away the mean of all counts";

  std::fill(evidence.pixels.begin(), evidence.pixels.end(), 0.0f);
  EXPECT_EQ(inverse::spread_to_unseen(change, evidence, surface).pixels, change.pixels) << "nothing was seen";
}

TEST(fit, gives_slots_without_texture_one_that_the_views_resolve) {
  Task task = make_task();
  const auto result = inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), {}, {});
  EXPECT_GE(result.maps[0].roughness.texels.width, 16);
  EXPECT_LE(result.maps[0].roughness.texels.width, 64);
  inverse::FitOptions options = quick();
  options.texture_size = 48;
  Task sized = make_task();
  const auto exact = inverse::fit_materials(sized.world.scene, {sized.views, sized.edited}, options, {}, {});
  for (const asset::MapSlotRow& row : asset::kMapSlots)
    EXPECT_EQ(asset::slot_map(exact.maps[0], row.slot).texels.width, 48) << row.name;
}

TEST(fit, an_automatic_size_holds_what_the_views_resolve_and_never_shrinks) {
  inverse::FitOptions options = quick();
  options.texture_size = inverse::kAutoTextureSize;
  Task task = make_task();
  const int own = task.world.scene.materials()[0].base_color.texels.width;
  const auto result = inverse::fit_materials(task.world.scene, {task.views, task.edited}, options, {}, {});
  const int width = result.maps[0].base_color.texels.width;
  EXPECT_GT(width, own);
  EXPECT_LE(width, 128);  // of views of 40 pixels
  ASSERT_FALSE(result.density.empty());
  EXPECT_EQ(result.density[0].width, width);
  EXPECT_GE(result.density[0].texels_per_pixel, 1.0f);
  EXPECT_LT(result.density[0].texels_per_pixel, 4.0f);

  Task large = make_task();
  auto maps = large.world.scene.materials();
  std::vector<asset::MaterialMaps> enlarged(maps.begin(),
                                            maps.begin() + large.world.scene.num_asset_materials());
  enlarged[0].base_color = asset::resized(enlarged[0].base_color, 512, 256);
  large.world.scene.set_asset_materials(enlarged);
  const auto kept = inverse::fit_materials(large.world.scene, {large.views, large.edited}, options, {}, {});
  EXPECT_EQ(kept.maps[0].base_color.texels.width, 512);
  EXPECT_EQ(kept.maps[0].base_color.texels.height, 256);
}

TEST(fit, keeps_every_value_in_range) {
  Task task = make_task();
  for (float& value : task.edited[0].pixels)
    value = value > 0.4f ? 1.0f : 0.0f;  // no material looks like this
  const auto result = inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), {}, {});
  for (const auto& maps : result.maps) {
    for (const float v : maps.base_color.texels.pixels) EXPECT_TRUE(v >= 0.0f && v <= 1.0f) << v;
    for (const float v : maps.roughness.texels.pixels) EXPECT_TRUE(v >= 0.03f && v <= 1.0f) << v;
    for (size_t i = 0; i < maps.normal.texels.num_pixels(); ++i) {
      const vec3 n(maps.normal.texels.pixels[3 * i], maps.normal.texels.pixels[3 * i + 1],
                   maps.normal.texels.pixels[3 * i + 2]);
      EXPECT_GT(n.z, 0.0f);
      EXPECT_NEAR(glm::length(n), 1.0f, 1e-4f);
    }
  }
}

TEST(fit, refuses_views_of_another_size) {
  Task task = make_task();
  task.edited[0] = Image(10, 10, 3);
  EXPECT_THROW(inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), {}, {}), Error);
  task.edited.clear();
  EXPECT_THROW(inverse::fit_materials(task.world.scene, {task.views, task.edited}, quick(), {}, {}), Error);
}

// Strengths of the floor (material 0) of 8 × 8 texels: black on its left half, and the wall may change
// freely.
std::vector<asset::Map> half_masked() {
  std::vector<asset::Map> strength(2);
  strength[0].texels = Image(8, 8, 1);
  for (int y = 0; y < 8; ++y)
    for (int x = 4; x < 8; ++x) *strength[0].texels.at(x, y) = 1.0f;
  strength[1].texels = Image(1, 1, 1, 1.0f);
  return strength;
}

// A map at the size of the fit's result: as it came, or resampled, which makes normals shorter than one.
Image at_size_of(const Image& result, const asset::Map& map, asset::MapEncoding encoding) {
  Image texels = asset::resized(map, result.width, result.height).texels;
  const bool same_size = map.texels.width == result.width && map.texels.height == result.height;
  if (same_size || encoding != asset::MapEncoding::kNormal) return texels;
  for (size_t i = 0; i < texels.pixels.size(); i += 3) {
    float* n = &texels.pixels[i];
    const vec3 unit = glm::normalize(vec3(n[0], n[1], n[2]));
    n[0] = unit.x, n[1] = unit.y, n[2] = unit.z;
  }
  return texels;
}

TEST(fit, texels_without_strength_keep_their_values_in_every_map) {
  Task task = make_task(64);
  const std::vector<asset::Map> strength = half_masked();
  inverse::FitOptions options = quick();
  const auto before = task.world.scene.materials();
  for (const int size : {0, 32}) {  // 32: textures finer than the mask
    options.texture_size = size;
    const auto result =
        inverse::fit_materials(task.world.scene, {task.views, task.edited, {}, strength}, options, {}, {});
    for (const asset::MapSlotRow& row : asset::kMapSlots) {
      if (!has(options.maps, row.slot)) continue;
      const asset::Map& now = slot_map(result.maps[0], row.slot);
      const Image old = at_size_of(now.texels, slot_map(before[0], row.slot), row.encoding);
      const auto channels = static_cast<size_t>(old.channels);
      // Resampled normals were normalised by other code than the test's, which may round otherwise.
      const float rounding = size > 0 && row.encoding == asset::MapEncoding::kNormal ? 3e-7f : 0.0f;
      size_t changed = 0;
      for (size_t i = 0; i < old.num_pixels(); ++i) {
        const bool same = std::equal(&old.pixels[i * channels], &old.pixels[i * channels] + channels,
                                     &now.texels.pixels[i * channels],
                                     [&](float a, float b) { return std::abs(a - b) <= rounding; });
        const bool masked = 2 * (static_cast<int>(i) % old.width) < old.width;
        if (masked) {
          EXPECT_TRUE(same) << row.name << " texel " << i;
        } else {
          changed += !same;
        }
      }
      if (row.slot == asset::MapSlot::kBaseColor) {
        EXPECT_GT(changed, old.num_pixels() / 4);
      }
    }
  }
}

TEST(fit, full_strength_everywhere_is_a_fit_without_masks) {
  Task task = make_task(), again = make_task();
  std::vector<asset::Map> strength(2);
  strength[0].texels = Image(8, 8, 1, 1.0f);
  strength[1].texels = Image(1, 1, 1, 1.0f);
  inverse::FitOptions options = quick();
  const auto plain = inverse::fit_materials(task.world.scene, {task.views, task.edited}, options, {}, {});
  const auto masked =
      inverse::fit_materials(again.world.scene, {again.views, again.edited, {}, strength}, options, {}, {});
  EXPECT_EQ(all_texels(masked), all_texels(plain));
}

}  // namespace
}  // namespace patina::test
