// What bench_noise measures on one asset: whiteness, correlation between views against its bound, seconds.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "patina/correspond/noise.h"
#include "patina/correspond/noise_agreement.h"
#include "patina/render/scene.h"

namespace patina::bench {

inline constexpr int kLatentScale = 8;

/// Smallest and largest of what was added.
struct Range {
  double lo = 1e30, hi = -1e30;
  void add(double value) {
    lo = std::min(lo, value);
    hi = std::max(hi, value);
  }
  void add(const Range& other) {
    lo = std::min(lo, other.lo);
    hi = std::max(hi, other.hi);
  }
};

/// Each number is a mean over seeds: of one view with its background, which is what the sampler gets, or of
/// all views' latent pixels that show the surface.
struct Whiteness {
  Range mean, variance;
  double max_autocorrelation = 0;
  // Kolmogorov-Smirnov tests, one a view and seed, with the background.
  double smallest_ks_p = 1;
  int64_t ks_tests = 0, ks_below_1_percent = 0;
  void add(const Whiteness& other);
};
Whiteness measure_whiteness(const std::vector<correspond::NoiseField>& noises, int grid,
                            const std::vector<uint8_t>& surface);

/// The same surface in two views: which two, and what they share.
struct ViewPair {
  int from, to;
  std::vector<correspond::SharedPatch> patches;
};
/// All pairs from < to of `cameras`, by samples_per_side² rays a latent pixel.
std::vector<ViewPair> shared_by_all(const render::Scene& scene, const std::vector<render::Camera>& cameras,
                                    int samples_per_side);

/// Ratio of sums over all corresponding latent pixels of all pairs, and its standard deviation by chance.
struct ShareOfBound {
  double value = 0, deviation = 0;
  double mean_bound = 0;
  int64_t num_pairs = 0;  // of latent pixels
};
ShareOfBound share_of_bound(const std::vector<ViewPair>& pairs,
                            const std::vector<correspond::NoiseField>& noises, int grid);

/// Median texels of a field_size² field that a latent pixel covers across, by its UV area; 0 where it has
/// none.
double texels_across(const render::Scene& scene, const std::vector<render::Camera>& cameras, int field_size);

struct AssetRow {
  Whiteness whiteness;
  ShareOfBound exact, paper;              // all pairs of nine views, 40° apart and more
  ShareOfBound exact_close, paper_close;  // neighbours turned by 7°
  double texels_across = 0;
  int64_t num_triangles = 0;
  double seconds_noise = 0, seconds_correspondences = 0;  // nine 512² views, best of three
  double seconds_16x1024 = 0;                             // both together, once
  double seconds_consistency = 0;  // nine 512² views, G-buffers not counted, best of three
};
AssetRow measure_asset(const asset::Asset& asset, int num_seeds);

/// Wall seconds of one call; `best` of several spares what other jobs on the machine cost.
double seconds_of(const std::function<void()>& job);
double best_seconds_of(int repetitions, const std::function<void()>& job);

/// 1 … count.
std::vector<uint64_t> seeds(int count);

/// `cameras` of `num_views` on the default orbit at `resolution`, of which the first `keep` stay.
std::vector<render::Camera> orbit(const asset::Asset& asset, int num_views, int resolution, int keep);

}  // namespace patina::bench
