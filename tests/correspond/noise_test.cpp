// View-correlated noise: correlation between views, independence elsewhere, and how
// options and bad input are met. Whiteness stands in noise_states_test.cpp and noise_assets_test.cpp.
#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/correspond/noise.h"
#include "patina/correspond/noise_agreement.h"
#include "worlds.h"

namespace patina::correspond {
namespace {

using namespace test;

constexpr int kNumSeeds = 4;

std::vector<NoiseField> noises_of(const World& world, const std::vector<render::Camera>& cameras,
                                  NoiseMode mode) {
  return make_noises(*world.scene, cameras, 8, {.mode = mode}, std::array<uint64_t, kNumSeeds>{0, 1, 2, 3});
}

// Mean statistics over views and seeds, each of 64² × 4 numbers: sixteen of them have a deviation of a
// quarter of one's.
NoiseStatistics mean_statistics(const std::vector<NoiseField>& noises, int grid,
                                float* smallest_p = nullptr) {
  NoiseStatistics mean;
  float count = 0;
  float smallest = 1;
  for (const NoiseField& noise : noises) {
    for (const NoiseStatistics& s : noise_statistics(noise, grid)) {
      mean.mean += s.mean;
      mean.variance += s.variance;
      mean.autocorrelation_x += s.autocorrelation_x;
      mean.autocorrelation_y += s.autocorrelation_y;
      smallest = std::min(smallest, s.kolmogorov_smirnov_p);
      ++count;
    }
  }
  mean.mean /= count, mean.variance /= count, mean.autocorrelation_x /= count,
      mean.autocorrelation_y /= count;
  if (smallest_p) *smallest_p = smallest;
  return mean;
}

TEST(Noise, exact_reaches_the_bound_of_overlap_at_every_turn) {
  const World world = sphere_world(UvState::kClean);
  const auto cameras = cameras_at({0, 7, 20, 40}, 512);
  const auto noises = noises_of(world, cameras, NoiseMode::kExact);
  for (int other = 1; other < 4; ++other) {
    const NoiseAgreement agreement = noise_agreement(*world.scene, cameras, 8, noises, 0, other);
    EXPECT_GT(agreement.num_pairs, 500);
    EXPECT_GT(agreement.bound, 0.3);
    EXPECT_NEAR(share_of_bound(agreement), 1.0, 0.05) << "view " << other << ", bound " << agreement.bound;
  }
}

TEST(Noise, paper_loses_most_of_the_bound_where_texels_are_finer_than_its_samples) {
  // A sphere of 64 latent pixels across half its circumference: a latent pixel covers 8 × 16 of the 1024²
  // texels.
  const World world = sphere_world(UvState::kClean);
  const auto cameras = cameras_at({0, 7, 20, 40}, 512);
  const auto noises = noises_of(world, cameras, NoiseMode::kPaper);
  const NoiseAgreement agreement = noise_agreement(*world.scene, cameras, 8, noises, 0, 1);
  EXPECT_LT(share_of_bound(agreement), 0.5);
  EXPECT_GT(share_of_bound(agreement), 0.02);
  const NoiseStatistics mean = mean_statistics(noises, 2);
  EXPECT_NEAR(mean.mean, 0.0f, 0.02f);
  EXPECT_NEAR(mean.variance, 1.0f, 0.05f);
}

TEST(Noise, paper_follows_the_bound_where_its_samples_are_as_fine_as_texels) {
  const World world = sphere_world(UvState::kClean);
  const auto cameras = cameras_at({0, 7, 20, 40}, 512);
  std::vector<NoiseField> noises;
  for (uint64_t seed = 0; seed < kNumSeeds; ++seed)
    noises.push_back(make_noise(*world.scene, cameras, 8, {NoiseMode::kPaper, 256, seed}));
  EXPECT_GT(share_of_bound(noise_agreement(*world.scene, cameras, 8, noises, 0, 1)), 0.6);
}

TEST(Noise, independent_views_are_unrelated) {
  const World world = sphere_world(UvState::kClean);
  const auto cameras = cameras_at({0, 7, 20, 40}, 512);
  const auto noises = noises_of(world, cameras, NoiseMode::kIndependent);
  const NoiseAgreement agreement = noise_agreement(*world.scene, cameras, 8, noises, 0, 1);
  EXPECT_NEAR(agreement.correlation, 0.0,
              4.0 / std::sqrt(4.0 * kNumSeeds * static_cast<double>(agreement.num_pairs)));
  const NoiseStatistics mean = mean_statistics(noises, 2);
  EXPECT_NEAR(mean.variance, 1.0f, 0.012f);
}

TEST(Noise, background_is_independent_and_partial_pixels_take_their_share) {
  // A plane that ends in the middle of a column of latent pixels: coverage 1, one half, 0.
  const World world = make_world({{scenes::quad(vec3(-2, -2, 0), vec3(2, 0, 0), vec3(0, 4, 0)), {}}});
  const render::Camera camera = render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 15 * 8, 15 * 8);
  const std::vector<render::Camera> same(4, camera);
  std::array<double, 3> products{};
  constexpr int kSeeds = 200;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    const NoiseField noise = make_noise(*world.scene, same, 8, {NoiseMode::kExact, 1024, seed});
    for (size_t y = 0; y < 15; ++y)
      for (size_t column = 0; column < 3; ++column)  // the middle one, and its neighbours
        products[column] += noise.values[y * 30 + 6 + column] * noise.values[y * 30 + 15 + 6 + column];
  }
  // Two equal cameras: the correlation is the share of the variance that the surface has. 3,000 products: ±
  // 0.02.
  EXPECT_NEAR(products[0] / (15 * kSeeds), 1.0, 0.1);
  EXPECT_NEAR(products[1] / (15 * kSeeds), 0.5, 0.08);
  EXPECT_NEAR(products[2] / (15 * kSeeds), 0.0, 0.08);
}

TEST(Noise, mirrored_halves_are_unrelated) {
  // Both halves of this sphere read the same texels; seen from the mirror plane both are in view.
  const World world = sphere_world(UvState::kMirrored);
  const auto cameras = cameras_at({0, 90, 180, 270}, 512);
  double exact = 0, paper = 0;
  int count = 0;
  for (uint64_t seed = 0; seed < kNumSeeds; ++seed) {
    const NoiseField a = make_noise(*world.scene, cameras, 8, {NoiseMode::kExact, 256, seed});
    const NoiseField b = make_noise(*world.scene, cameras, 8, {NoiseMode::kPaper, 256, seed});
    for (size_t y = 16; y < 48; ++y)
      for (size_t x = 12; x < 30; ++x) {
        exact += a.values[y * 128 + x] * a.values[y * 128 + 63 - x];
        paper += b.values[y * 128 + x] * b.values[y * 128 + 63 - x];
        ++count;
      }
  }
  EXPECT_NEAR(exact / count, 0.0, 4.0 / std::sqrt(count));
  EXPECT_GT(paper / count,
            0.3);  // the published noise repeats itself here, which shows that the test can see it
}

TEST(Noise, hidden_and_turned_away_surface_gives_nothing) {
  // Camera 0 sees a plane, camera 1 looks at its back, a shield stands before camera 2: no view shares
  // anything with view 0.
  const auto plane = scenes::quad(vec3(-4, -4, 0), vec3(8, 0, 0), vec3(0, 8, 0));
  const auto shield = scenes::quad(vec3(-4, -4, 1), vec3(8, 0, 0), vec3(0, 8, 0));
  const World open = make_world({{plane, {}}});
  const World shielded = make_world({{plane, {}}}, {{shield, {}}});
  const render::Camera front = render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 256, 256);
  const render::Camera back = render::look_at(vec3(0, 0, -5), vec3(0.0f), 0.5f, 256, 256);
  const auto correlation = [](const NoiseField& noise, size_t shift, bool mirrored) {
    double sum = 0;
    for (size_t y = 0; y < 32; ++y)
      for (size_t x = 0; x < 32; ++x)
        sum += noise.values[y * 64 + x] * noise.values[y * 64 + shift + (mirrored ? 31 - x : x)];
    return sum / 1024.0;
  };
  const NoiseOptions options;
  const double limit = 4.0 / 32.0;
  EXPECT_NEAR(
      correlation(make_noise(*open.scene, std::vector{front, front, front, front}, 8, options), 32, false),
      1.0, 0.15);
  EXPECT_NEAR(
      correlation(make_noise(*open.scene, std::vector{front, back, back, back}, 8, options), 32, true), 0.0,
      limit);
  EXPECT_NEAR(correlation(make_noise(*shielded.scene, std::vector{front, front, front, front}, 8, options),
                          32, false),
              0.0, limit);
  // Both sides of a double-sided sheet carry one texture, and so one noise.
  const World both = make_world({{plane, {}}}, {}, true);
  EXPECT_NEAR(
      correlation(make_noise(*both.scene, std::vector{front, back, back, back}, 8, options), 32, true), 1.0,
      0.2);
}

TEST(Noise, holes_of_a_mask_take_no_part) {
  // Through a sheet that is all hole the views see a wall; the sheet's own points would dilute its noise.
  scenes::Constant hole;
  hole.alpha = 0.0f;
  hole.alpha_mode = asset::AlphaMode::kMask;
  const auto wall = scenes::quad(vec3(-2, -2, 0), vec3(4, 0, 0), vec3(0, 4, 0));
  const auto sheet = scenes::quad(vec3(-2, -2, 1), vec3(4, 0, 0), vec3(0, 4, 0));
  const World world = make_world({{wall, {}}, {sheet, hole}});
  const auto cameras = cameras_at({-20, 0, 20, 40}, 256);
  const auto noises = noises_of(world, cameras, NoiseMode::kExact);
  EXPECT_NEAR(share_of_bound(noise_agreement(*world.scene, cameras, 8, noises, 0, 1)), 1.0, 0.1);
}

TEST(Noise, empty_view_is_white) {
  const World world = sphere_world(UvState::kClean, 8);
  const render::Camera away = render::look_at(vec3(0, 0, 5), vec3(0, 0, 10), 0.5f, 512, 512);
  for (const NoiseMode mode : {NoiseMode::kIndependent, NoiseMode::kPaper, NoiseMode::kExact}) {
    const NoiseField noise = make_noise(*world.scene, std::vector{away}, 8, {mode, 1024, 3});
    const NoiseStatistics s = noise_statistics(noise, 1)[0];
    EXPECT_NEAR(s.variance, 1.0f, 0.045f);
    EXPECT_GT(s.kolmogorov_smirnov_p, 0.001f);
  }
}

TEST(Noise, repeats_bit_for_bit_with_any_number_of_threads) {
  const World world = sphere_world(UvState::kClean, 16);
  const auto cameras = cameras_at({0, 90, 180, 270}, 128);
  for (const NoiseMode mode : {NoiseMode::kIndependent, NoiseMode::kPaper, NoiseMode::kExact}) {
    const NoiseOptions options{mode, 1024, 9};
    const NoiseField first = make_noise(*world.scene, cameras, 8, options);
    set_num_threads(1);
    const NoiseField second = make_noise(*world.scene, cameras, 8, options);
    set_num_threads(0);
    EXPECT_EQ(first.values, second.values);
    NoiseOptions other = options;
    other.seed = 10;
    EXPECT_NE(first.values, make_noise(*world.scene, cameras, 8, other).values);
  }
}

TEST(Noise, several_seeds_at_once_are_those_one_by_one) {
  const World world = sphere_world(UvState::kClean, 16);
  const auto cameras = cameras_at({0, 90, 180, 270}, 64);
  for (const NoiseMode mode : {NoiseMode::kIndependent, NoiseMode::kPaper, NoiseMode::kExact}) {
    const auto both = make_noises(*world.scene, cameras, 8, {.mode = mode}, std::array<uint64_t, 2>{7, 3});
    ASSERT_EQ(both.size(), 2u);
    EXPECT_EQ(both[0].values, make_noise(*world.scene, cameras, 8, {.mode = mode, .seed = 7}).values);
    EXPECT_EQ(both[1].values, make_noise(*world.scene, cameras, 8, {.mode = mode, .seed = 3}).values);
  }
}

TEST(Noise, sizes_follow_the_views) {
  const World world = sphere_world(UvState::kClean, 8);
  std::vector<render::Camera> cameras(9, render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 72, 40));
  const NoiseField noise = make_noise(*world.scene, cameras, 8, {});
  EXPECT_EQ(noise.width, 27);
  EXPECT_EQ(noise.height, 15);
  EXPECT_EQ(noise.values.size(), 4u * 27u * 15u);
  for (const float value : noise.values) EXPECT_TRUE(std::isfinite(value));
}

TEST(Noise, rejects_sizes_and_options_that_do_not_fit) {
  const World world = sphere_world(UvState::kClean, 8);
  const render::Camera odd = render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 100, 96);
  const render::Camera even = render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 96, 96);
  EXPECT_THROW(make_noise(*world.scene, std::vector{odd}, 8, {}), Error);
  EXPECT_THROW(make_noise(*world.scene, std::vector{even, even}, 8, {}), Error);
  EXPECT_THROW(make_noise(*world.scene, std::vector{even, even, even, odd}, 4, {}), Error);
  EXPECT_THROW(make_noise(*world.scene, std::vector{even}, 0, {}), Error);
  EXPECT_THROW(make_noise(*world.scene, std::vector{even}, 8, {NoiseMode::kPaper, 0, 0}), Error);
  for (const int subpixels : {0, 65})
    EXPECT_THROW(
        make_noise(*world.scene, std::vector{even}, 8, {.mode = NoiseMode::kPaper, .subpixels = subpixels}),
        Error);
  for (const float points : {0.0f, -1.0f, std::numeric_limits<float>::infinity()})
    EXPECT_THROW(make_noise(*world.scene, std::vector{even}, 8, {.points_per_latent = points}), Error);
}

TEST(Noise, reports_progress_and_stops_when_asked) {
  const World world = sphere_world(UvState::kClean, 8);
  const std::vector<render::Camera> cameras(4, render::look_at(vec3(0, 0, 5), vec3(0.0f), 0.5f, 64, 64));
  double last = 0;
  Progress progress;
  progress.on_update = [&](std::string_view task, double done, double total) {
    EXPECT_EQ(task, "noise");
    last = done / total;
  };
  make_noise(*world.scene, cameras, 8, {}, progress);
  EXPECT_EQ(last, 1.0);
  progress.stop_requested = [] { return true; };
  EXPECT_THROW(make_noise(*world.scene, cameras, 8, {}, progress), Error);
}

}  // namespace
}  // namespace patina::correspond
