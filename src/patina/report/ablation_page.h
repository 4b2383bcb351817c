// The page of an ablation: what each prior adds, in pictures and numbers, as the ablation figure and the
// table of time and memory of [Hadadan2025, Sec. 6 and Table 1].
#pragma once

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/image/image.h"

namespace patina::report {

/// NaN: not measured.
inline constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

struct AblationMeasures {
  double edit_correlation = kNotMeasured;  // of the edit between views
  double edit_psnr = kNotMeasured;         // dB
  double edit_sharpness = kNotMeasured;    // fine detail of the edited views over that of the renders
  double texture_sharpness =
      kNotMeasured;                    // of renders with the fitted textures over that of the edited views
  double texture_psnr = kNotMeasured;  // dB, of those renders against the edited views
  // Seconds.
  double noise_seconds = kNotMeasured, correspond_seconds = kNotMeasured, diffusion_seconds = kNotMeasured,
         fit_seconds = kNotMeasured;
  // Largest resident memory, MB.
  double diffusion_mb = kNotMeasured, fit_mb = kNotMeasured;
};

/// Pictures are sRGB; empty: there is none.
struct AblationRow {
  std::string title, note;   // "+ attention bias", "w = 1.2"
  Image views;               // all views as one grid
  std::vector<Image> crops;  // one surface point in several views, as AblationPage::crop_titles names them
  Image rendered_crop;       // the first of them with the fitted textures
  Image texture_crop;        // base colour around the point
  Image texture;             // the whole of it
  AblationMeasures measures;
};

/// Time and memory of the last step with other numbers of views.
struct ViewCountRow {
  int num_views = 0, resolution = 0;
  int64_t num_latent_pixels = 0;  // of the grid
  double noise_seconds = 0, correspond_seconds = 0, diffusion_seconds = 0, diffusion_mb = 0;
};

struct AblationPage {
  std::string title, prompt, negative_prompt;
  std::vector<std::string> facts;  // HTML, as page_heading takes them
  std::vector<std::string> crop_titles;
  AblationRow conditioning;  // without measures
  std::vector<AblationRow> steps;
  std::vector<ViewCountRow> view_counts;  // empty: no such table
  std::string view_count_step;            // title of the step that the table is about
  std::string machine;                    // processor, threads
  nlohmann::json config;
  std::vector<std::string> warnings;
};

void write_ablation_page(const std::filesystem::path& path, const AblationPage& page);

}  // namespace patina::report
