// Composed training samples on disk: made once, so that an epoch costs reading, not composing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <ATen/core/Tensor.h>
#include <c10/core/Device.h>

#include "mini_data/dataset.h"
#include "patina/base/files.h"
#include "patina/base/progress.h"

namespace patina::train_mini {

/// Samples of several views of one object follow each other.
struct Sample {
  std::string caption, asked_class;
  int group_views = 1, view = 0;
};

/// Pictures of a sample, in the order of a record.
inline constexpr int64_t kTile = 0, kNormal = 1, kTarget = 2;

/// FOLDER/pictures.u8 holds one record a sample, bytes [3 pictures, 3 channels, 256, 256]: tile, normal and
/// target as mini_data::Batch has them, 255 means 1. FOLDER/samples.jsonl holds one line a sample.
class SampleFolder {
 public:
  /// Maps what is there now. Throws Error{kNotFound, kFormat}.
  explicit SampleFolder(const std::filesystem::path& folder);

  const std::vector<Sample>& samples() const { return samples_; }
  int64_t size() const { return static_cast<int64_t>(samples_.size()); }
  /// [3,3,256,256] uint8, lying in the map.
  at::Tensor pictures(int64_t index) const;

 private:
  MappedFile file_;
  std::vector<Sample> samples_;
};

struct SampleOptions {
  mini_data::Part part = mini_data::Part::kTraining;
  int64_t count = 4000;
  uint64_t seed = 0;
  c10::Device device = c10::kCPU;
};

/// Appends to `folder` until it holds `count` samples; every fourth plan is one of four views of its object,
/// the others of one. What an earlier, killed call left is kept.
void make_samples(const std::filesystem::path& shards, const std::filesystem::path& folder,
                  const SampleOptions& options, const Progress& progress);

}  // namespace patina::train_mini
