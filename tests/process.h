// Runs a program as a user would, and tells what came of it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace patina::test {

struct ProcessResult {
  int exit_code = -1;      // -1: ended by a signal
  int signal = 0;          // the signal that ended it, 0: none
  double seconds = 0;      // wall clock
  double peak_rss_mb = 0;  // largest resident memory
  std::string output;      // standard output
  std::string error;       // standard error
};

struct ProcessLimits {
  double seconds = 600;   // then it is killed
  double kill_after = 0;  // > 0: kill it (SIGKILL) after this many seconds, as a power cut would
};

ProcessResult run_process(const std::vector<std::string>& arguments, const ProcessLimits& limits = {});

/// A program of the build folder that the running test belongs to: "patina".
std::filesystem::path built_program(const std::string& name);

}  // namespace patina::test
