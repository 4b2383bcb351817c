// What a fit is given and asked for, what it tells on the way and what it returns.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "patina/asset/material_maps.h"
#include "patina/image/image.h"

namespace patina::views {
struct ViewSet;
}

namespace patina::inverse {

/// What a fit works on. Refers to the views, the images and the strengths.
struct FitInputs {
  const views::ViewSet& views;    // renders of the materials as they are
  std::span<const Image> edited;  // what the views shall look like: one sRGB [H,W,3] in [0,1] a view
  std::vector<bool> materials{};  // which materials may change; empty: all of the asset
  // How strongly, one map a material (asset/strength_map.h): texels at zero keep their value. Empty:
  // everything may change.
  std::span<const asset::Map> strength{};
  // The views before they were edited, as `edited` has them. What the fit's own light shows of the materials
  // as they are is compared with them, so that what was not edited stays. Empty: its light is taken as it is.
  std::span<const Image> clean{};
};

/// FitOptions::texture_size: a power of two that keeps what the views resolve, never below the asset's own.
inline constexpr int kAutoTextureSize = -1;

struct FitOptions {
  int iterations = 24;
  int texture_size = 0;  // texels a side of fitted maps; 0: the asset's own size, or what the views resolve
                         // for factor-only slots; kAutoTextureSize
  asset::MapSet maps =
      asset::set_of({asset::MapSlot::kBaseColor, asset::MapSlot::kRoughness, asset::MapSlot::kMetallic,
                     asset::MapSlot::kNormal});  // that may change
  int light_samples = 8;       // incident directions traced from a point; each pixel has up to eight
  int max_depth = 4;           // of the paths that gather incident light
  int boundary_pixels = 3;     // pixels beside silhouettes and depth edges that do not count
  bool fill_unseen = true;     // unseen texels get the change around them (unseen.h)
  bool keep_in_place = false;  // do not move views that disagree toward each other (alignment.h)
  uint64_t seed = 0;
};

/// State between iterations that restores a run exactly.
struct FitCheckpoint {
  int next_iteration = 0;
  std::vector<uint8_t> bytes;
};

/// How finely the views sample a fitted map.
struct MapDensity {
  int material = 0;
  int width = 0, height = 0;   // of the map that was fitted
  float texels_per_pixel = 0;  // along one side; below 1 the views show more than the map can hold
};

struct FitResult {
  std::vector<asset::MaterialMaps> maps;  // one entry a material of the asset
  std::vector<asset::MapSet> changed;
  std::vector<float> loss;  // per iteration
  float psnr = 0;           // dB, re-rendered (cache) against edited views, sRGB, over unmasked pixels
  std::vector<MapDensity> density;  // of base colours, one a material that was fitted
  std::vector<Image> evidence;  // per material [h,w,1]: weight with which views saw each base-colour texel
};

/// How far a fit has come.
struct FitPreview {
  std::span<const Image> rendered;  // one a view, sRGB [H,W,3], as the light cache shows it; black where
                                    // pixels count nothing
  std::span<const float> loss;      // per iteration so far
};

struct FitHooks {
  std::function<void(const FitCheckpoint&)>
      on_checkpoint;         // now and then (at least every 30 s), when the fit is stopped, and at the end
  int every_iterations = 0;  // more often than that: a checkpoint each this many iterations; 0: by time alone
  std::optional<FitCheckpoint> resume;
  std::function<void(const FitPreview&)> on_preview;  // every five seconds, and at the end
  std::function<void(const FitResult&)> on_stop;  // as far as it came, before Error{kInterrupted} is thrown
};

}  // namespace patina::inverse
