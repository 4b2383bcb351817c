// Everything a run of patina can be told, in one aggregate. Options (options.h) fill it; each stage is given
// its part of it (settings.h).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/pipeline/settings.h"
#include "patina/render/scene.h"
#include "patina/views/view_set.h"

namespace patina::pipeline {

/// What --preset chose; its values are written into the other fields.
enum class Preset { kUsual, kDraft, kFast, kQuality };

/// What every stage works on: files, and the cameras. Read anew by every command (workbench.h); stages have
/// the content in their keys.
struct InputSettings {
  std::filesystem::path asset;
  std::vector<std::string> materials;          // names of the materials that may change; empty: all that can
  std::filesystem::path environment;           // empty: the built-in studio
  std::filesystem::path scene;                 // context that is rendered and never changed; may be empty
  std::filesystem::path cameras;               // explicit cameras instead of the orbit; may be empty
  views::OrbitOptions orbit{.resolution = 0};  // 0: what the model was trained at, see settle()
  render::BsdfModel bsdf = render::BsdfModel::kGltf;
};

struct Config {
  Preset preset = Preset::kUsual;
  std::filesystem::path output;  // empty: no export
  float blend = 1.0f;            // share of the new textures in the output (blend.h)
  std::filesystem::path run;     // empty: beside the output, <output stem>.patina-run
  bool keep = false;             // what was changed by hand in the run folder stays when its stage runs again

  int num_seeds = 1;  // above 1: so many edits, and nothing beyond (variants.h)

  InputSettings inputs;
  MaskSettings masks;
  RenderSettings render;
  EditSettings edit;
  FitSettings fit;
  ReportSettings report;

  int num_threads = 0;                  // 0: all processors; the program applies it
  std::filesystem::path bundled_model;  // the folder of patina-mini that the program found; may be empty
};

/// Fills in what depends on the model: the bundled one where none is given or where its name is, and the
/// resolution that the model was trained at where none is given.
void settle(Config& config);

}  // namespace patina::pipeline
