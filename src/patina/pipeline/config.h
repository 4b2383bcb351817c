// Everything a run of patina can be told, in one aggregate. Options (options.h) fill it; stages read it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "patina/correspond/noise.h"
#include "patina/diffusion/options.h"
#include "patina/inverse/fit_options.h"
#include "patina/render/path_tracer.h"
#include "patina/views/view_set.h"

namespace patina::pipeline {

/// What --preset chose; its values are written into the other fields.
enum class Preset { kUsual, kFast, kQuality };

struct Config {
  Preset preset = Preset::kUsual;

  // What goes in and out.
  std::filesystem::path asset;
  std::filesystem::path output;        // empty: no export
  std::filesystem::path run;           // empty: beside the output, <output stem>.patina-run
  std::vector<std::string> materials;  // names of the materials that may change; empty: all that can

  // How it is lit and seen.
  std::filesystem::path environment;           // empty: the built-in studio
  std::filesystem::path scene;                 // context that is rendered and never changed; may be empty
  std::filesystem::path cameras;               // explicit cameras instead of the orbit; may be empty
  views::OrbitOptions orbit{.resolution = 0};  // 0: what the model was trained at, see settle()
  int samples_per_pixel = 64;
  int max_depth = 6;
  std::optional<float> exposure_ev;  // nullopt: automatic
  render::BsdfModel bsdf = render::BsdfModel::kGltf;

  // What the diffusion model does.
  diffusion::ModelPaths model;
  diffusion::Dtype dtype = diffusion::Dtype::kAuto;
  diffusion::Device device = diffusion::Device::kAuto;
  bool low_memory = false;
  diffusion::EditOptions detail{.bias_weight = 1.8f};  // docs/decisions/0012
  correspond::NoiseMode noise = correspond::NoiseMode::kExact;

  // How the detail is carried into the textures.
  inverse::FitOptions fit;

  // The report.
  int turntable_frames = 24;  // 0: no turntable

  uint64_t seed = 0;    // of all random numbers
  int num_threads = 0;  // 0: all processors
};

}  // namespace patina::pipeline
