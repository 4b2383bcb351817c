// View-correlated noise over all shared assets that have UVs: whiteness, how much of the possible correlation
// between views each mode reaches, and seconds for nine 512² views (noise and correspondences).
//   bench_noise [OUT.json]      default: bench/noise.json beside the program; assets from $PATINA_SHARED,
//   else ../shared
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/parallel.h"
#include "patina/correspond/correspondences.h"
#include "patina/correspond/noise.h"
#include "patina/correspond/noise_agreement.h"
#include "patina/views/view_set.h"

namespace {

using namespace patina;
using Clock = std::chrono::steady_clock;

std::vector<std::filesystem::path> asset_files(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> out;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    if (extension == ".gltf" || extension == ".glb" || extension == ".obj") out.push_back(entry.path());
  }
  std::sort(out.begin(), out.end());
  return out;
}

bool has_uvs(const asset::Asset& asset) {
  return std::any_of(asset.primitives.begin(), asset.primitives.end(),
                     [](const asset::Primitive& p) { return !p.uv.empty() && !p.uv[0].empty(); });
}

// Sums of measured correlation and bound over pairs of views; their ratio is the share of the bound.
double share_of_bound(const render::Scene& scene, const std::vector<render::Camera>& cameras,
                      correspond::NoiseMode mode, const std::vector<std::pair<int, int>>& pairs) {
  std::vector<correspond::NoiseField> noises;
  for (uint64_t seed = 1; seed <= 2; ++seed)
    noises.push_back(correspond::make_noise(scene, cameras, 8, {mode, 1024, seed}));
  double correlation = 0, bound = 0;
  for (const auto& [from, to] : pairs) {
    const auto agreement = correspond::noise_agreement(scene, cameras, 8, noises, from, to);
    correlation += agreement.correlation * static_cast<double>(agreement.num_pairs);
    bound += agreement.bound * static_cast<double>(agreement.num_pairs);
  }
  return bound > 0 ? correlation / bound : 0;
}

nlohmann::json measure(const asset::Asset& asset) {
  const render::Scene scene(asset, asset::resolve_materials(asset), render::constant_environment(vec3(1.0f)));
  const auto bounds = asset::bounds(asset);
  const auto cameras = views::orbit_cameras(bounds, {});  // nine views of 512², 40° apart
  views::OrbitOptions fine;
  fine.num_views = 51;  // 7.06° apart, of which four are used
  auto close = views::orbit_cameras(bounds, fine);
  close.resize(4);

  const auto start = Clock::now();
  const auto noise = correspond::make_noise(scene, cameras, 8, {});
  const auto between = Clock::now();
  const auto levels = correspond::bias_levels(scene, cameras);
  const auto end = Clock::now();

  double mean = 0, variance = 0, autocorrelation = 0, smallest_p = 1;
  const auto statistics = correspond::noise_statistics(noise, 3);
  for (const auto& s : statistics) {
    mean += static_cast<double>(s.mean) / 9.0;
    variance += static_cast<double>(s.variance) / 9.0;
    for (const float a : {s.autocorrelation_x, s.autocorrelation_y})
      autocorrelation = std::max(autocorrelation, std::abs(static_cast<double>(a)));
    smallest_p = std::min(smallest_p, static_cast<double>(s.kolmogorov_smirnov_p));
  }
  const std::vector<std::pair<int, int>> far{{0, 1}, {3, 4}, {6, 7}}, near{{0, 1}, {1, 2}, {2, 3}};
  using enum correspond::NoiseMode;
  return {{"mean", mean},
          {"variance", variance},
          {"autocorrelation_worst", autocorrelation},
          {"ks_p_smallest", smallest_p},
          {"exact_of_bound_7deg", share_of_bound(scene, close, kExact, near)},
          {"paper_of_bound_7deg", share_of_bound(scene, close, kPaper, near)},
          {"exact_of_bound", share_of_bound(scene, cameras, kExact, far)},
          {"paper_of_bound", share_of_bound(scene, cameras, kPaper, far)},
          {"biased_keys", levels[0].keys.size()},
          {"seconds_noise", std::chrono::duration<double>(between - start).count()},
          {"seconds_9x512", std::chrono::duration<double>(end - start).count()}};
}

}  // namespace

int main(int argc, char** argv) {
  const char* shared = std::getenv("PATINA_SHARED");
  const std::filesystem::path assets = std::filesystem::path(shared ? shared : "../shared") / "assets";
  const std::filesystem::path out =
      argc > 1 ? std::filesystem::path(argv[1])
               : std::filesystem::path(argv[0]).parent_path() / "bench" / "noise.json";
  if (!std::filesystem::exists(assets)) {
    std::fprintf(stderr, "%s does not exist; set PATINA_SHARED to the folder that holds assets/\n",
                 assets.c_str());
    return 1;
  }
  nlohmann::json rows = nlohmann::json::array();
  std::printf("%d threads; shares of the bound at 7° and 40°\n", num_threads());
  std::printf("%-42s %7s %7s %7s %7s  %6s %6s  %6s %6s  %6s\n", "asset", "mean", "var", "autoc", "ks p",
              "exact7", "paper7", "exact", "paper", "s");
  for (const auto& path : asset_files(assets)) {
    const std::string name = std::filesystem::relative(path, assets).string();
    try {
      const asset::Asset asset = asset::read_asset(path);
      if (!has_uvs(asset)) continue;
      nlohmann::json row = measure(asset);
      row["asset"] = name;
      std::printf("%-42.42s %7.4f %7.4f %7.4f %7.4f  %6.3f %6.3f  %6.3f %6.3f  %6.2f\n", name.c_str(),
                  row["mean"].get<double>(), row["variance"].get<double>(),
                  row["autocorrelation_worst"].get<double>(), row["ks_p_smallest"].get<double>(),
                  row["exact_of_bound_7deg"].get<double>(), row["paper_of_bound_7deg"].get<double>(),
                  row["exact_of_bound"].get<double>(), row["paper_of_bound"].get<double>(),
                  row["seconds_9x512"].get<double>());
      std::fflush(stdout);
      rows.push_back(std::move(row));
    } catch (const Error& error) {
      std::printf("%-42.42s skipped: %s\n", name.c_str(), error.what());
    }
  }
  write_file(out, rows.dump(1));
  std::printf("wrote %s\n", out.c_str());
  return 0;
}
