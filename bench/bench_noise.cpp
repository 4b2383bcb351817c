// View-correlated noise on real assets: whiteness, how much of the possible correlation between views each
// mode reaches, and seconds.
//
//   bench_noise [--out FILE] [--only TEXT] [--seeds N]   every asset with UVs, or those whose path holds TEXT
//   bench_noise --sweep ASSET                            share of the bound against samples a latent pixel
//   bench_noise --picture ASSET OUT.png [--views 51]     two neighbours of so many views a turn
//
// Assets are those of $PATINA_SHARED, else ../shared; FILE is build/bench/noise.json unless given. Takes some
// five minutes on two cores. What the figures mean: docs/noise.md.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "console/numbers.h"
#include "console/program.h"
#include "noise_measure.h"
#include "noise_picture.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/parallel.h"
#include "patina/correspond/footprint.h"
#include "patina/image/image_io.h"

namespace {

using namespace patina;
using namespace patina::bench;
namespace fs = std::filesystem;
using nlohmann::json;

std::vector<fs::path> asset_files(const fs::path& folder) {
  std::vector<fs::path> out;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const fs::path extension = entry.path().extension();
    if (extension == ".gltf" || extension == ".glb" || extension == ".obj") out.push_back(entry.path());
  }
  std::sort(out.begin(), out.end());
  return out;
}

bool has_uvs(const asset::Asset& asset) {
  return std::any_of(asset.primitives.begin(), asset.primitives.end(),
                     [](const asset::Primitive& p) { return !p.uv.empty() && !p.uv[0].empty(); });
}

json pair_of(const Range& range) {
  return json::array({range.lo, range.hi});
}

json to_json(const AssetRow& row) {
  return {{"triangles", row.num_triangles},
          {"mean_range", pair_of(row.whiteness.mean)},
          {"variance_range", pair_of(row.whiteness.variance)},
          {"max_autocorrelation", row.whiteness.max_autocorrelation},
          {"smallest_ks_p", row.whiteness.smallest_ks_p},
          {"exact_of_bound", row.exact.value},
          {"exact_of_bound_deviation", row.exact.deviation},
          {"paper_of_bound", row.paper.value},
          {"mean_bound", row.exact.mean_bound},
          {"pairs_of_latents", row.exact.num_pairs},
          {"exact_of_bound_7deg", row.exact_close.value},
          {"paper_of_bound_7deg", row.paper_close.value},
          {"texels_across_latent", row.texels_across},
          {"seconds_noise_9x512", row.seconds_noise},
          {"seconds_correspondences_9x512", row.seconds_correspondences},
          {"seconds_9x512", row.seconds_noise + row.seconds_correspondences},
          {"seconds_16x1024", row.seconds_16x1024},
          {"seconds_consistency_9x512", row.seconds_consistency}};
}

// Over assets, which count alike; one whose views share no surface has no share of the bound.
struct MeanShare {
  double sum = 0;
  int count = 0;
  void add(const ShareOfBound& share) {
    if (share.num_pairs > 0) sum += share.value, ++count;
  }
  double value() const { return count > 0 ? sum / count : 0; }
};

// What all assets say together.
struct Summary {
  Whiteness whiteness;
  MeanShare exact, paper, exact_close, paper_close;
  double largest_deviation = 0;
  int num_assets = 0, num_left_out = 0;
  double seconds_9x512 = 0, seconds_16x1024 = 0, seconds_consistency = 0;

  void add(const AssetRow& row) {
    whiteness.add(row.whiteness);
    exact.add(row.exact);
    paper.add(row.paper);
    exact_close.add(row.exact_close);
    paper_close.add(row.paper_close);
    largest_deviation = std::max(largest_deviation, row.exact.deviation);
    seconds_9x512 = std::max(seconds_9x512, row.seconds_noise + row.seconds_correspondences);
    seconds_16x1024 = std::max(seconds_16x1024, row.seconds_16x1024);
    seconds_consistency = std::max(seconds_consistency, row.seconds_consistency);
    ++num_assets;
  }

  json to_json(int num_seeds) const {
    const double numbers = 4.0 * 64 * 64 * num_seeds;  // of one view over all seeds
    return {{"exact_of_bound", exact.value()},
            {"paper_of_bound", paper.value()},
            {"max_autocorrelation", whiteness.max_autocorrelation},
            {"variance_range", pair_of(whiteness.variance)},
            {"seconds_9x512", seconds_9x512},
            {"mean_range", pair_of(whiteness.mean)},
            {"smallest_ks_p", whiteness.smallest_ks_p},
            {"details",
             {{"num_assets", num_assets},
              {"num_left_out", num_left_out},
              {"num_threads", num_threads()},
              {"num_seeds", num_seeds},
              // By chance alone, for a view's mean over all seeds.
              {"deviation_of_mean", std::sqrt(1.0 / numbers)},
              {"deviation_of_variance", std::sqrt(2.0 / numbers)},
              {"deviation_of_autocorrelation", std::sqrt(1.0 / numbers)},
              {"largest_deviation_of_exact_of_bound", largest_deviation},
              {"ks_tests", whiteness.ks_tests},
              {"ks_share_below_0.01", static_cast<double>(whiteness.ks_below_1_percent) /
                                          static_cast<double>(std::max<int64_t>(whiteness.ks_tests, 1))},
              // That the smallest of so many independent p-values is as small.
              {"ks_p_of_smallest",
               1.0 - std::pow(1.0 - whiteness.smallest_ks_p, static_cast<double>(whiteness.ks_tests))},
              {"exact_of_bound_7deg", exact_close.value()},
              {"paper_of_bound_7deg", paper_close.value()},
              {"seconds_16x1024", seconds_16x1024},
              {"seconds_consistency_9x512", seconds_consistency}}}};
  }
};

void measure_all(const fs::path& assets, const fs::path& out, const std::string& only, int num_seeds) {
  std::vector<fs::path> files = asset_files(assets);
  std::erase_if(files, [&](const fs::path& file) { return file.string().find(only) == std::string::npos; });
  std::printf("%d threads, %d seeds; shares of the bound over all pairs of nine views, and at 7 degrees\n",
              num_threads(), num_seeds);
  std::printf("%7s %-36s %13s %6s %7s  %6s %6s  %6s %6s %6s  %5s %5s %5s\n", "", "asset", "variance", "autoc",
              "ks p", "exact", "paper", "exact7", "paper7", "texels", "9x512", "16x1k", "cons.");
  Summary summary;
  json rows = json::array();
  for (size_t i = 0; i < files.size(); ++i) {
    const std::string name = fs::relative(files[i], assets).string();
    std::printf("[%2zu/%2zu] %-36.36s ", i + 1, files.size(), name.c_str());
    std::fflush(stdout);
    std::string left_out;
    try {
      const asset::Asset asset = asset::read_asset(files[i]);
      if (has_uvs(asset)) {
        const AssetRow row = measure_asset(asset, num_seeds);
        std::printf("%6.4f %6.4f %6.4f %7.5f  %6.3f %6.3f  %6.3f %6.3f %6.1f  %5.2f %5.2f %5.2f\n",
                    row.whiteness.variance.lo, row.whiteness.variance.hi, row.whiteness.max_autocorrelation,
                    row.whiteness.smallest_ks_p, row.exact.value, row.paper.value, row.exact_close.value,
                    row.paper_close.value, row.texels_across, row.seconds_noise + row.seconds_correspondences,
                    row.seconds_16x1024, row.seconds_consistency);
        summary.add(row);
        rows.push_back(to_json(row));
        rows.back()["asset"] = name;
      } else {
        left_out = "no UVs";
      }
    } catch (const Error& error) {
      left_out = error.what();
    }
    if (left_out.empty()) continue;
    std::printf("left out: %s\n", left_out.c_str());
    ++summary.num_left_out;
    rows.push_back({{"asset", name}, {"left_out", left_out}});
  }
  json all = summary.to_json(num_seeds);
  std::printf("%s\n", all.dump(1).c_str());
  all["assets"] = std::move(rows);
  write_file(out, all.dump(1));
  std::printf("wrote %s\n", out.c_str());
  if (summary.num_assets == 0)
    throw Error(ErrorCode::kNotFound, assets.string(), "holds no asset with UVs that could be measured");
}

// Share of the bound, whiteness on the surface and cost of nine 512² views against samples a latent pixel.
void sweep(const fs::path& file) {
  constexpr int kSeeds = 64;
  const asset::Asset asset = asset::read_asset(file);
  const render::Scene scene(asset, asset::resolve_materials(asset), render::constant_environment(vec3(1.0f)));
  const auto cameras = orbit(asset, 9, 512, 9), close = orbit(asset, 51, 512, 4);
  const auto pairs = shared_by_all(scene, cameras, 32), close_pairs = shared_by_all(scene, close, 32);
  const auto surface = correspond::surface_mask(scene, cameras, kLatentScale);
  std::printf("%s: a latent pixel covers %.1f of the 1024 texels across\n", file.c_str(),
              texels_across(scene, cameras, 1024));
  std::printf("%-22s %8s %8s %16s %8s %8s\n", "samples a latent pixel", "7 deg", "40+ deg", "variance",
              "autoc", "seconds");
  const auto print_row = [&](const std::string& name, const correspond::NoiseOptions& options) {
    const double seconds =
        best_seconds_of(3, [&] { correspond::make_noise(scene, cameras, kLatentScale, options); });
    const auto noises = correspond::make_noises(scene, cameras, kLatentScale, options, seeds(kSeeds));
    const auto close_noises = correspond::make_noises(scene, close, kLatentScale, options, seeds(kSeeds));
    const Whiteness whiteness = measure_whiteness(noises, 3, surface);
    std::printf("%-22s %8.3f %8.3f %7.4f %8.4f %8.4f %8.3f\n", name.c_str(),
                share_of_bound(close_pairs, close_noises, 2).value, share_of_bound(pairs, noises, 3).value,
                whiteness.variance.lo, whiteness.variance.hi, whiteness.max_autocorrelation, seconds);
    std::fflush(stdout);
  };
  using enum correspond::NoiseMode;
  for (const int subpixels : {4, 8, 16, 32})
    print_row("paper, " + std::to_string(subpixels) + " x " + std::to_string(subpixels),
              {.mode = kPaper, .subpixels = subpixels});
  for (const int points : {3, 12, 48, 192})
    print_row("exact, " + std::to_string(points) + " points",
              {.mode = kExact, .points_per_latent = static_cast<float>(points)});
}

void run_all(const fs::path& out, const std::string& only, int num_seeds) {
  const char* shared = std::getenv("PATINA_SHARED");
  const fs::path assets = fs::path(shared ? shared : "../shared") / "assets";
  if (!fs::exists(assets))
    throw Error(ErrorCode::kNotFound, assets.string(),
                "does not exist; set PATINA_SHARED to the folder that holds assets/");
  measure_all(assets, out, only, num_seeds);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("View-correlated noise on real assets: whiteness, correlation between views, seconds.",
                   "bench_noise");
  fs::path out = "build/bench/noise.json", swept;
  std::string only;
  int num_seeds = 32, num_views = 51;
  std::vector<std::string> pictured;
  program.add_option("--out", out, "JSON to write")->capture_default_str();
  program.add_option("--only", only, "Assets whose path holds this text");
  program.add_option("--seeds", num_seeds, "Of an asset")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  CLI::Option* sweep_option =
      program.add_option("--sweep", swept, "ASSET: share of the bound against samples a latent pixel");
  program.add_option("--picture", pictured, "ASSET OUT.png: the noise of two neighbouring views")
      ->expected(2)
      ->excludes(sweep_option);
  program.add_option("--views", num_views, "Of a turn, in the picture")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  return tools::run_program(program, argc, argv, [&] {
    if (!swept.empty()) return sweep(swept);
    if (pictured.empty()) return run_all(out, only, num_seeds);
    write_image(pictured[1], noise_picture(asset::read_asset(pictured[0]), num_views));
  });
}
