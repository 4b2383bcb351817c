// The report of a run: one self-contained HTML page, contact sheets, a loss curve, and a turntable.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/base/progress.h"
#include "patina/image/image.h"
#include "patina/render/path_tracer.h"
#include "patina/render/scene.h"
#include "patina/report/exemplars.h"
#include "patina/report/other_light.h"
#include "patina/report/parts.h"
#include "patina/report/where.h"

namespace patina::report {

/// Images side by side, `columns` a row, on a neutral ground, scaled to `tile_width` pixels. [H,W,3] sRGB.
Image contact_sheet(std::span<const Image> images, int columns, int tile_width);

/// Share of high-frequency energy kept: Σ m·(Y − blur(Y))² of `image` over that of `reference`, Y = Rec. 709
/// luminance of the sRGB values, blur a Gaussian of σ = 1 pixel (half amplitude at 0.19 cycles/pixel)
/// normalised inside the mask, so that the silhouette does not count; 1 is as sharp, above 1 is noise.
/// mask [H,W,1] in [0,1] or empty; NaN where it is zero everywhere.
float sharpness_kept(const Image& image, const Image& reference, const Image& mask);

/// Peak signal-to-noise ratio in dB over pixels weighted by `mask` ([H,W,1] or empty), peak 1. Infinity when
/// equal, NaN where the mask is zero everywhere.
float psnr(const Image& a, const Image& b, const Image& mask = {});

struct TexturePair {
  std::string material, slot;  // "base colour", "normal", "roughness", "metallic"
  Image before, after;         // as they are shown: sRGB or encoded normal, [0,1]
};

struct ReportData {
  std::string title;  // asset file name
  std::string prompt, negative_prompt;
  std::vector<Image> before, edited, after;  // one a view, sRGB
  std::vector<TexturePair> textures;
  std::vector<RelitPictures> relit;
  std::vector<MaskPicture> masks;
  std::vector<Image> strength;  // of the masks, one a view (where.h); empty: none
  std::vector<ExemplarPicture> exemplars;
  std::vector<PartWords> parts;
  std::vector<Image> part_views;  // one a view (parts.h); empty: none
  std::vector<float> loss;
  nlohmann::json config, metrics;
  std::vector<std::string> warnings;
  std::string viewer;               // viewer_data(); empty: nothing to turn
  std::filesystem::path turntable;  // relative to the page; empty: none (embedded as data)
};

/// Writes report.html: everything inside it (images as data URIs), readable without network, light and dark,
/// prints well.
void write_report(const std::filesystem::path& path, const ReportData& data);

/// Carries cameras[0] once around the vertical axis through the asset's middle in `frames` steps, and writes
/// what it sees as an animated WebP, before and after side by side. Both scenes hold the same geometry;
/// lights stand still.
struct TurntableOptions {
  int frames = 24;
  int resolution = 256;
  int samples_per_pixel = 16;
  int max_depth = render::PathOptions{}.max_depth;
  uint64_t seed = 0;
  float exposure_ev = 0;
  float seconds = 4;
};
void write_turntable(const std::filesystem::path& path, const render::Scene& before,
                     const render::Scene& after, std::span<const render::Camera> cameras,
                     const TurntableOptions& options, const Progress& progress);

/// Writes frames ([H,W,3] sRGB, one size) as an endless animated WebP.
void write_animation(const std::filesystem::path& path, std::span<const Image> frames, float seconds);

}  // namespace patina::report
