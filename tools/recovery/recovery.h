// A fit whose answer is known: an asset's textures are flattened to their means, views of the true ones are
// the targets. Shared by the test of the whole fit and by bench_inverse.
#pragma once

#include <filesystem>

#include "patina/inverse/fit.h"

namespace patina::test {

struct RecoveryOptions {
  int num_views = 9;
  int resolution = 256;               // pixels a side of each view
  int samples_per_pixel = 128;        // of the path-traced targets
  std::filesystem::path environment;  // an HDR map; empty: the studio
  int shift = 0;                      // pixels by which each target is moved, in a direction of its own
  inverse::FitOptions fit;
};

struct Recovery {
  asset::Asset asset;
  std::vector<asset::MaterialMaps> truth, start;
  views::ViewSet views;        // rendered with the true maps by the path tracer
  std::vector<Image> targets;  // sRGB, moved by `shift`
  inverse::FitResult fit;
  std::vector<Image> num_views;  // per material, of the base colour's size: how many views see a texel
  double target_seconds = 0, fit_seconds = 0;
};
Recovery recover(const std::filesystem::path& asset_path, const RecoveryOptions& options,
                 const Progress& progress = {});

/// Whether errors are taken over a base-colour texel: it has evidence of at least a tenth of a pixel and is
/// seen by `min_views` views.
bool counts(const Recovery& recovery, size_t material, size_t texel, int min_views);

/// How near maps are to the truth, over the base-colour texels of all materials that count.
struct MapErrors {
  double base_color_psnr = 0;  // dB, sRGB-encoded values, peak 1
  double resolved_psnr = 0;    // the same with texels averaged over two pixels of a view: no view shows finer
  double roughness_mae = 0;
  double metallic_mae = 0;
  double normal_degrees = 0;  // mean angle
  double seen_share = 0;      // of all texels
};
MapErrors map_errors(const Recovery& recovery, const std::vector<asset::MaterialMaps>& maps,
                     int min_views = 1);

/// PSNR in dB of two recoveries' base colours against each other, over texels that count in both.
double base_color_agreement(const Recovery& a, const Recovery& b, int min_views);

/// Share of the true views' fine detail that renders of the recovered maps have (report::sharpness_kept),
/// mean over views, away from silhouettes.
double sharpness_kept(const Recovery& recovery, const RecoveryOptions& options);

/// True, starting and recovered views side by side, and the same of one map's texels as they are shown.
Image view_strip(const Recovery& recovery, size_t view, int samples_per_pixel);
Image texture_strip(const Recovery& recovery, asset::MapSlot slot, int size);

}  // namespace patina::test
