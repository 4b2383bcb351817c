#include "console/console_progress.h"

#include <chrono>
#include <cstdio>

namespace patina::tools {

Progress console_progress() {
  Progress progress;
  const auto start = std::chrono::steady_clock::now();
  progress.on_update = [start](std::string_view task, double done, double total) {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const double left = done > 0 ? seconds * (total - done) / done : 0;
    std::fprintf(stderr, "\r%.*s %.0f of %.0f, %.0f s gone, about %.0f s left   %s",
                 static_cast<int>(task.size()), task.data(), done, total, seconds, left,
                 done >= total ? "\n" : "");
  };
  progress.on_warning = [](std::string_view text) {
    std::fprintf(stderr, "\nwarning: %.*s\n", static_cast<int>(text.size()), text.data());
  };
  return progress;
}

}  // namespace patina::tools
