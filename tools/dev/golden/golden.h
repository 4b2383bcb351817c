// Checks a model folder against stored inputs and outputs of the reference implementation (diffusers and
// transformers). What a file holds is told from its name and its tensors; all sizes come from the tensors.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace patina::diffusion {

/// The outcome of one file.
struct GoldenResult {
  std::string name;        // the file, without its extension
  std::string worst;       // the tensor nearest to its limit
  double difference = 0;   // largest absolute difference of that tensor
  double limit = 0;        // what it may be
  size_t num_tensors = 0;  // how many were compared
  std::string fault;       // why the file could not be compared; empty if it was

  bool ok() const { return fault.empty() && difference <= limit && num_tensors > 0; }
};

/// The files that check_golden_file understands or should: everything below `folder` but indices and
/// tolerances, sorted.
std::vector<std::filesystem::path> golden_files(const std::filesystem::path& folder);

/// Loads each part of the model when a file first needs it, in f32.
class GoldenChecker {
 public:
  GoldenChecker(std::filesystem::path model, std::filesystem::path golden);
  ~GoldenChecker();

  /// `file` is one of golden_files. Faults of the file become the result's `fault`; a broken model throws
  /// Error.
  GoldenResult check(const std::filesystem::path& file);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace patina::diffusion
