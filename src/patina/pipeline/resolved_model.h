// The diffusion model of a run: its files are found once and handed on, its networks are loaded by the first
// edit that needs them.
#pragma once

#include <memory>
#include <string>

#include "patina/diffusion/model.h"
#include "patina/pipeline/settings.h"

namespace patina::pipeline {

class ResolvedModel {
 public:
  /// Finds and checks all files without loading weights. Throws Error{kUsage} where no model is named, and
  /// Error that names what is missing, broken or cannot run on this device.
  explicit ResolvedModel(const EditSettings& settings);
  ~ResolvedModel();
  ResolvedModel(ResolvedModel&&) noexcept;
  ResolvedModel& operator=(ResolvedModel&&) noexcept;

  /// Of the names, sizes and dates of all files: weights are gigabytes, these tell whether they changed.
  const std::string& hash() const;

  /// The networks; loaded by the first call. They stay until unload(), after which they cannot be loaded
  /// again.
  const diffusion::Model& loaded();
  bool is_loaded() const;
  void unload();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace patina::pipeline
