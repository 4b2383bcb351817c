// Samples for the trainer of the material prior: composed views with the material maps of both pictures, made
// once and read from disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include <ATen/core/Tensor.h>

#include "mini_data/dataset.h"
#include "patina/base/files.h"
#include "patina/base/progress.h"
#include "patina/prior/material_network.h"

namespace patina::train_material {

/// FOLDER/records.u8 holds one record a sample: planes [kNumPlanes,256,256] u8, 255 means 1. "Clean" is what
/// was there, "true" what the edited picture shows. Colours are sRGB, normals ½ + ½ n in the camera's frame.
enum Plane {
  kEdited = 0,
  kRender = 3,
  kCleanNormal = 6,
  kCleanBase = 9,
  kCleanRoughness = 12,
  kCleanMetallic,
  kTrueBase,
  kTrueRoughness = kTrueBase + 3,
  kTrueMetallic,
  kTrueNormal,
  kCoverage = kTrueNormal + 3,
  kNumPlanes
};

class Records {
 public:
  /// Maps what is there now. Throws Error{kNotFound, kFormat}.
  explicit Records(const std::filesystem::path& folder);

  int64_t size() const { return size_; }
  /// [kNumPlanes,256,256] f32 [0,1].
  at::Tensor record(int64_t index) const;

 private:
  MappedFile file_;
  int64_t size_;
};

struct RecordOptions {
  mini_data::Part part = mini_data::Part::kTraining;
  int64_t count = 1000;
  uint64_t seed = 0;
  /// What an autoencoder makes of pictures [B,3,256,256] in [0,1]; every third edited picture goes through
  /// it. Empty: none.
  std::function<at::Tensor(const at::Tensor&)> through_autoencoder;
};

/// Appends to FOLDER until it holds `count` samples; what an earlier, killed call left is kept.
void make_records(const std::filesystem::path& shards, const std::filesystem::path& folder,
                  const RecordOptions& options, const Progress& progress);

/// A batch [B,kNumPlanes,H,W] f32 [0,1] as what the network sees and what it should answer.
struct Truth {
  at::Tensor base_color;                   // [B,3,H,W] sRGB
  at::Tensor roughness, metallic, weight;  // [B,1,H,W]; weight 1 on pixels that the object fills
  at::Tensor normal, slope;                // [B,3,H,W], [B,2,H,W]
};
prior::MaterialInputs inputs_of(const at::Tensor& planes);
Truth truth_of(const at::Tensor& planes);

}  // namespace patina::train_material
