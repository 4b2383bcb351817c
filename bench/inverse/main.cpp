// How well and how fast inverse rendering finds known textures: an asset's textures are flattened to their
// means, nine views of the true ones, rendered by the path tracer, are the targets. Writes errors, seconds
// and memory as JSON after every asset, goes on where it was stopped, draws strips "true | start |
// recovered", and leaves the first asset's scene for mitsuba_peer.py.
//
// The first asset's targets are also moved against each other by 1, 2 and 4 pixels, and by none, to see how
// much fine detail conflicting views leave; and it is fitted with more and fewer views, pixels and texels, to
// see what each costs. Both at half the resolution.
//
// Part `aged` (aged.h): fits from clean assets to aged ones, judged under other light as well.
//
//   bench_inverse [--part known|aged] [--shared ../shared] [--resolution 512] [--samples 128]
//                 [--iterations 24] [--only NAME]
//                 [--out build/bench/inverse.json] [--pictures build/bench/inverse]
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string>

#include <nlohmann/json.hpp>

#include "aged.h"
#include "console/numbers.h"
#include "console/program.h"
#include "export_scene.h"
#include "path_replay_fit.h"
#include "patina/asset/map_slots.h"
#include "patina/base/files.h"
#include "patina/base/memory.h"
#include "patina/image/image_io.h"
#include "patina/render/path_tracer.h"
#include "recovery/recovery.h"

namespace {

namespace fs = std::filesystem;
using namespace patina;
using nlohmann::json;

// The first is relit, and timed against path replay.
constexpr const char* kAssets[] = {"WaterBottle/WaterBottle.gltf", "BoomBoxWithAxes/BoomBoxWithAxes.gltf",
                                   "MaterialsVariantsShoe/MaterialsVariantsShoe.gltf", "Suzanne/Suzanne.gltf",
                                   "ToyCar/ToyCar.gltf"};
constexpr const char* kOtherEnvironment = "assets/hdri/st_fagans_interior_1k.hdr";
constexpr int kMinViews = 2;             // that see a texel that counts
constexpr int kShifts[] = {0, 1, 2, 4};  // pixels by which targets are moved against each other
constexpr int kRenderSamples = 64;
constexpr int kReplayPaths = 8;  // a pixel: as many as the cache keeps directions

struct Options {
  fs::path shared = "../shared", out = "build/bench/inverse.json", pictures = "build/bench/inverse";
  std::string only, part = "known";
  test::RecoveryOptions recovery;
};

void draw(const test::Recovery& r, const fs::path& folder, const std::string& name) {
  fs::create_directories(folder);
  write_image(folder / (name + "_views.png"), test::view_strip(r, 3, 256));
  for (const asset::MapSlot slot :
       {asset::MapSlot::kBaseColor, asset::MapSlot::kRoughness, asset::MapSlot::kNormal})
    write_image(folder / (name + "_" + asset::row_of(slot).name + ".png"), test::texture_strip(r, slot, 384));
}

json measured(const test::Recovery& r) {
  const test::MapErrors start = test::map_errors(r, r.start, kMinViews),
                        found = test::map_errors(r, r.fit.maps, kMinViews);
  return {{"base_color_psnr", found.base_color_psnr},
          {"resolved_psnr", found.resolved_psnr},
          {"roughness_mae", found.roughness_mae},
          {"normal_degrees", found.normal_degrees},
          {"seen_share", found.seen_share},
          {"start_psnr", start.base_color_psnr},
          {"start_roughness_mae", start.roughness_mae},
          {"start_normal_degrees", start.normal_degrees},
          {"rerendered_psnr", r.fit.psnr},
          {"seconds", r.fit_seconds}};
}

bool has(const json& report, const std::string& name) {
  for (const json& entry : report["assets"])
    if (entry["name"] == name) return true;
  return false;
}

json conflicting(const test::RecoveryOptions& options, const fs::path& asset, const fs::path& pictures) {
  json all = json::array();
  for (const int shift : kShifts)
    for (const bool keep_in_place : {false, true}) {
      test::RecoveryOptions moved = options;
      moved.shift = shift;
      moved.fit.keep_in_place = keep_in_place;
      const test::Recovery r = test::recover(asset, moved);
      all.push_back({{"pixels", shift},
                     {"aligned", !keep_in_place},
                     {"sharpness_kept", test::sharpness_kept(r, moved)},
                     {"base_color_psnr", test::map_errors(r, r.fit.maps, kMinViews).base_color_psnr},
                     {"seconds", r.fit_seconds}});
      std::printf("views moved by %d pixels, %s: sharpness kept %.3f, base colour %.2f dB, %.1f s\n", shift,
                  keep_in_place ? "as they lie" : "aligned", all.back()["sharpness_kept"].get<double>(),
                  all.back()["base_color_psnr"].get<double>(), r.fit_seconds);
      std::fflush(stdout);
      draw(r, pictures, "moved_" + std::to_string(shift) + (keep_in_place ? "_as_they_lie" : "_aligned"));
    }
  return all;
}

// Seconds and noise of the views' renders: the root of the pixels' mean variance, from two renders with
// different seeds, over their mean radiance, where the asset covers a pixel wholly. Mitsuba's share is
// measured by mitsuba_peer.py.
json render_noise(const test::Recovery& r, int max_depth) {
  render::PathOptions path;
  path.samples_per_pixel = kRenderSamples;
  path.max_depth = max_depth;
  const render::Scene scene(r.asset, r.truth, render::studio_environment());
  double seconds = 0, variance = 0, radiance = 0, count = 0;
  for (const views::View& view : r.views.views) {
    const auto begin = std::chrono::steady_clock::now();
    path.seed = 0;
    const render::Render rendered = render::render(scene, view.camera, path);
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    path.seed = 1;
    const render::Render again = render::render(scene, view.camera, path);
    for (size_t i = 0; i < rendered.coverage.pixels.size(); ++i) {
      if (rendered.coverage.pixels[i] < 1.0f) continue;
      for (size_t c = 0; c < 3; ++c) {
        const double value = rendered.radiance.pixels[3 * i + c];
        variance += std::pow(value - again.radiance.pixels[3 * i + c], 2) / 2;
        radiance += value;
        count += 1;
      }
    }
  }
  return {{"samples", kRenderSamples},
          {"seconds", seconds},
          {"relative_noise", std::sqrt(variance / count) / (radiance / count)}};
}

// Seconds of the first asset's fit, each of views, resolution and texture size changed for itself.
json cost(const test::RecoveryOptions& options, const fs::path& asset) {
  const int resolution = options.resolution;
  struct Setting {
    const char* changed;
    int num_views, resolution, texture_size;
  };
  const Setting settings[] = {{"views", 4, resolution, 0},           {"views", 9, resolution, 0},
                              {"views", 16, resolution, 0},          {"resolution", 9, resolution / 2, 0},
                              {"resolution", 9, resolution, 0},      {"resolution", 9, 2 * resolution, 0},
                              {"texture_size", 9, resolution, 1024}, {"texture_size", 9, resolution, 2048},
                              {"texture_size", 9, resolution, 4096}};
  json all = json::array();
  for (const Setting& setting : settings) {
    test::RecoveryOptions changed = options;
    changed.num_views = setting.num_views;
    changed.resolution = setting.resolution;
    changed.fit.texture_size = setting.texture_size;
    const test::Recovery r = test::recover(asset, changed);
    all.push_back({{"changed", setting.changed},
                   {"views", setting.num_views},
                   {"resolution", setting.resolution},
                   {"texture_size", r.fit.maps[0].base_color.texels.width},
                   {"seconds", r.fit_seconds}});
    std::printf("cost: %2d views of %4d x %4d pixels, textures of %4d texels a side: %.1f s\n",
                setting.num_views, setting.resolution, setting.resolution,
                r.fit.maps[0].base_color.texels.width, r.fit_seconds);
    std::fflush(stdout);
  }
  return all;
}

// The assets' strips of views below each other.
void stack_strips(const fs::path& folder) {
  std::vector<Image> strips;
  for (const char* file : kAssets) {
    const fs::path strip = folder / (fs::path(file).stem().string() + "_views.png");
    if (!fs::exists(strip)) return;
    strips.push_back(read_image(strip));
  }
  Image all(strips[0].width, static_cast<int>(strips.size()) * strips[0].height, 3);
  for (size_t s = 0; s < strips.size(); ++s)
    for (int y = 0; y < strips[s].height; ++y)
      for (int x = 0; x < strips[s].width; ++x)
        all.set_rgb(x, static_cast<int>(s) * strips[s].height + y, strips[s].rgb(x, y));
  write_image(folder / "all_views.png", all);
}

json to_json(const bench::AgedErrors& errors) {
  return {{"normal_degrees", errors.normal_degrees},   {"normal_correlation", errors.normal_correlation},
          {"base_color_psnr", errors.base_color_psnr}, {"roughness_mae", errors.roughness_mae},
          {"metallic_right", errors.metallic_right},   {"relit_psnr", errors.relit_psnr}};
}

json run_ageing(const bench::Subject& subject, const bench::Ageing& ageing, const bench::AgedOptions& options,
                const fs::path& picture) {
  const bench::Aged aged = bench::age_and_fit(subject, ageing, options);
  const bench::AgedErrors start = aged_errors(aged, options, aged.start),
                          found = aged_errors(aged, options, aged.fit.maps);
  std::printf(
      "%-8s %-8s normals %.1f -> %.1f deg (correlation %.2f), base colour %.1f -> %.1f dB, roughness %.3f -> "
      "%.3f, metallic right %.2f, relit %.2f -> %.2f dB, %.1f s\n",
      subject.name, ageing.name, start.normal_degrees, found.normal_degrees, found.normal_correlation,
      start.base_color_psnr, found.base_color_psnr, start.roughness_mae, found.roughness_mae,
      found.metallic_right, start.relit_psnr, found.relit_psnr, aged.fit_seconds);
  std::fflush(stdout);
  fs::create_directories(picture.parent_path());
  write_image(picture, aged_picture(aged, options));
  return {{"start", to_json(start)},
          {"found", to_json(found)},
          {"fit_psnr", aged.fit.psnr},
          {"seconds", aged.fit_seconds}};
}

void run_aged(const Options& options) {
  bench::AgedOptions aged_options;
  aged_options.shared = options.shared;
  aged_options.resolution = options.recovery.resolution;
  aged_options.samples = options.recovery.samples_per_pixel;
  aged_options.fit = options.recovery.fit;
  json all = json::array();
  for (const bench::Subject& subject : bench::subjects())
    for (const bench::Ageing& ageing : bench::ageings()) {
      const std::string name = std::string(subject.name) + "_" + ageing.name;
      if (!options.only.empty() && name.find(options.only) == std::string::npos) continue;
      all.push_back(run_ageing(subject, ageing, aged_options, options.pictures / (name + ".png")));
      all.back()["name"] = name;
    }
  if (all.empty()) throw std::runtime_error("no ageing is called " + options.only);
  write_file(options.out, all.dump(1) + "\n");
}

// Throws where `only` is given and none of the assets.
void require_asset(const std::string& only) {
  std::string names;
  for (const char* file : kAssets) {
    const std::string name = fs::path(file).stem().string();
    if (only.empty() || only == name) return;
    names += (names.empty() ? "" : ", ") + name;
  }
  throw std::runtime_error("no asset is called " + only + "; there are " + names);
}

void run(const Options& options) {
  const json settings{{"resolution", options.recovery.resolution},
                      {"samples", options.recovery.samples_per_pixel},
                      {"iterations", options.recovery.fit.iterations}};
  json report = json::object();
  if (fs::exists(options.out)) report = json::parse(read_text_file(options.out));
  if (report.value("settings", json()) != settings)
    report = {{"settings", settings}, {"assets", json::array()}};
  require_asset(options.only);

  for (const char* file : kAssets) {
    const std::string name = fs::path(file).stem().string();
    if ((!options.only.empty() && options.only != name) || has(report, name)) continue;
    const test::Recovery r = test::recover(options.shared / "assets" / file, options.recovery);
    json entry = measured(r);
    entry["name"] = name;
    std::printf(
        "%-24s base colour %.2f -> %.2f dB, roughness MAE %.3f -> %.3f, normals %.2f -> %.2f deg, %.1f s\n",
        name.c_str(), entry["start_psnr"].get<double>(), entry["base_color_psnr"].get<double>(),
        entry["start_roughness_mae"].get<double>(), entry["roughness_mae"].get<double>(),
        entry["start_normal_degrees"].get<double>(), entry["normal_degrees"].get<double>(), r.fit_seconds);
    std::fflush(stdout);
    draw(r, options.pictures, name);
    if (file == kAssets[0]) {
      report["seconds_9x512"] = r.fit_seconds;
      report["peak_mb"] = static_cast<double>(peak_resident_bytes()) / 1048576;
      report["render"] = render_noise(r, options.recovery.fit.max_depth);
      bench::export_scene(r, kMinViews, options.pictures / "scene");
      const double replay = bench::path_replay_iteration_seconds(r, options.recovery.fit, kReplayPaths);
      report["reference_over_cache"] = replay * options.recovery.fit.iterations / r.fit_seconds;
      test::RecoveryOptions other = options.recovery;
      other.environment = options.shared / kOtherEnvironment;
      report["relit_psnr"] =
          test::base_color_agreement(r, test::recover(options.shared / "assets" / file, other), kMinViews);
      std::printf("path replay / light cache %.1f, base colours under two lights agree to %.2f dB\n",
                  report["reference_over_cache"].get<double>(), report["relit_psnr"].get<double>());
    }
    report["assets"].push_back(std::move(entry));
    write_file(options.out, report.dump(1) + "\n");
  }
  stack_strips(options.pictures);
  if (!options.only.empty()) return;
  test::RecoveryOptions half = options.recovery;
  half.resolution /= 2;
  const fs::path first = options.shared / "assets" / kAssets[0];
  if (!report.contains("cost")) {
    report["cost"] = cost(half, first);
    write_file(options.out, report.dump(1) + "\n");
  }
  if (!report.contains("conflicting_views")) {
    report["conflicting_views"] = conflicting(half, first, options.pictures);
    write_file(options.out, report.dump(1) + "\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("How well and how fast inverse rendering finds known textures.", "bench_inverse");
  Options options;
  test::RecoveryOptions& recovery = options.recovery;
  recovery.resolution = 512;
  program.add_option("--part", options.part, "What is measured")
      ->check(CLI::IsMember({"known", "aged"}))
      ->capture_default_str();
  program.add_option("--shared", options.shared, "Folder of shared assets")->capture_default_str();
  program.add_option("--resolution", recovery.resolution, "Of the views, pixels a side")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program.add_option("--samples", recovery.samples_per_pixel, "Of the targets, paths a pixel")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program.add_option("--iterations", recovery.fit.iterations, "Of a fit")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program.add_option("--only", options.only,
                     "Name of one asset, or part of the names of ageings: kettle_rust");
  program.add_option("--out", options.out, "JSON to write; known assets in it are left out")
      ->capture_default_str();
  program.add_option("--pictures", options.pictures, "Folder of the strips")->capture_default_str();
  return tools::run_program(program, argc, argv, [&] {
    if (options.part == "aged")
      run_aged(options);
    else
      run(options);
  });
}
