// What a run tells the outside beside the progress of its tasks: its stages, and what there is to see
// already.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "patina/base/progress.h"

namespace patina::pipeline {

/// What happens to a stage of a run. kReused: nothing that it reads has changed, so that it is not run again.
enum class StageEvent { kStarted, kReused, kFinished };

struct RunProgress : Progress {
  /// A stage begins, has ended or is left out. A program may reset the kernel's mark of the largest resident
  /// memory when one starts; the peak of the stage's record is then its own.
  std::function<void(std::string_view stage, StageEvent event)> on_stage = {};
  /// A page that shows how far a stage has come was written, or written anew.
  std::function<void(const std::filesystem::path& file)> on_preview = {};

  void tell_stage(std::string_view stage, StageEvent event) const {
    if (on_stage) on_stage(stage, event);
  }
  void tell_preview(const std::filesystem::path& file) const {
    if (on_preview) on_preview(file);
  }
};

}  // namespace patina::pipeline
