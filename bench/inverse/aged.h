// A fit from a clean asset to an aged one whose every map is known: photographed materials are laid over the
// asset's own in UV space, path-traced views of that are the targets, the fit starts at the clean asset.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "patina/inverse/fit.h"

namespace patina::bench {

/// An asset that ages.
struct Subject {
  const char* name;
  const char* asset;  // below the shared folder or, with "examples/", the repository
  int material;       // the asset's material that ages
};
std::span<const Subject> subjects();

/// How a material ages.
struct Ageing {
  const char* name;
  const char* photograph;  // below shared/materials
  float repeats;           // of the photograph over the unit square of UVs
  float slope;             // factor on the photograph's slopes
  float covered;           // share of the texels that get it, in patches; 1: all
  asset::MapSet maps;      // that the photograph changes; its metallic is `metallic`
  float metallic;
  // What the clean material is set to first, where given.
  std::optional<vec3> clean_color;  // linear
  std::optional<float> clean_roughness, clean_metallic;
};
std::span<const Ageing> ageings();

struct AgedOptions {
  std::filesystem::path shared = "../shared";
  int num_views = 9;
  int resolution = 256;  // pixels a side of each view
  int samples = 64;      // a pixel of the targets
  inverse::FitOptions fit;
};

struct Aged {
  const Subject* subject = nullptr;
  const Ageing* ageing = nullptr;
  asset::Asset asset;
  std::vector<asset::MaterialMaps> start, truth;
  views::ViewSet views;               // of the start
  std::vector<Image> clean, targets;  // start and truth, sRGB
  inverse::FitResult fit;
  double fit_seconds = 0;
};
/// Composes the truth, renders it and fits.
Aged age_and_fit(const Subject& subject, const Ageing& ageing, const AgedOptions& options);

/// How near maps are to the truth, over the pixels of all views that show the aged material and count in the
/// fit; maps are averaged over each pixel first, since no view shows finer.
struct AgedErrors {
  double normal_degrees = 0;      // mean angle between shading normals
  double normal_correlation = 0;  // cosine between how truth and maps depart from the start's normals
  double base_color_psnr = 0;     // dB, sRGB-encoded
  double roughness_mae = 0;
  double metallic_right = 0;  // share of the area whose metallic crosses 0.5 that is on the truth's side
  double relit_psnr = 0;      // dB, sRGB renders under other environments against the truth's
};
AgedErrors aged_errors(const Aged& aged, const AgedOptions& options,
                       const std::vector<asset::MaterialMaps>& maps);

/// Truth, start and recovered: a fitted view above, the same under another environment below.
Image aged_picture(const Aged& aged, const AgedOptions& options);

}  // namespace patina::bench
