// What each stage of a run is told. A stage function receives its own struct and no other, and the key that
// decides whether it runs again is the hash of that struct (stage_key.h): what a stage can read is in its
// key.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "patina/correspond/noise.h"
#include "patina/diffusion/options.h"
#include "patina/inverse/fit_options.h"
#include "patina/masks/places.h"

namespace patina::pipeline {

struct RenderSettings {
  int samples_per_pixel = 64;
  int max_depth = 6;                 // bounces of the longest path
  std::optional<float> exposure_ev;  // nullopt: automatic
  uint64_t seed = 0;
};

/// Where the asset may change, and how much there.
struct MaskSettings {
  std::vector<std::string> files;  // pictures: "FILE" for all materials that may change, or "MATERIAL=FILE"
  bool vertex_color = false;       // the mesh's own vertex colours too
  std::vector<std::string> strength_for;  // "MATERIAL=S": its share of the strength, in [0,1]
  std::vector<std::string> protect;       // names of materials that keep every pixel and texel
  std::vector<masks::PlaceAmount> where;  // what the asset's shape is like there; the largest counts

  bool any() const {
    return !files.empty() || vertex_color || !strength_for.empty() || !protect.empty() || !where.empty();
  }
};

struct EditSettings {
  diffusion::ModelPaths model;
  diffusion::Dtype dtype = diffusion::Dtype::kAuto;
  diffusion::Device device = diffusion::Device::kAuto;
  bool low_memory = false;
  correspond::NoiseMode noise = correspond::NoiseMode::kExact;
  std::vector<std::string> exemplars;                        // "[MATERIAL=]FILE[:WEIGHT]", see exemplars.h
  std::vector<std::string> prompt_for, negative_prompt_for;  // "MATERIAL=TEXT", see part_prompts.h
  diffusion::EditOptions options{.bias_weight = 1.8f};  // docs/decisions/0012; the initial noise has its seed
};

struct FitSettings {
  inverse::FitOptions options = [] {
    inverse::FitOptions usual;
    usual.max_depth = RenderSettings{}.max_depth;  // the light of the fit is that of the renders
    return usual;
  }();
};

struct ReportSettings {
  int turntable_frames = 24;  // 0: no turntable
  int samples_per_pixel = RenderSettings{}.samples_per_pixel;
  int max_depth = RenderSettings{}.max_depth;
  int boundary_pixels = inverse::FitOptions{}.boundary_pixels;  // not measured beside silhouettes
  uint64_t seed = 0;
};

}  // namespace patina::pipeline
