#include "wait_policy.h"

#include <cstdlib>

#if defined(__linux__)
#include <unistd.h>
#endif

namespace patina::app {

void sleep_between_parallel_regions(char** argv) {
#if defined(__linux__)
  if (std::getenv("OMP_WAIT_POLICY") || std::getenv("GOMP_SPINCOUNT")) return;
  ::setenv("OMP_WAIT_POLICY", "passive", 0);
  ::execv("/proc/self/exe", argv);
  // Where that fails (no /proc) the program goes on, with threads that spin.
#else
  static_cast<void>(argv);
#endif
}

}  // namespace patina::app
