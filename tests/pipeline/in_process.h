// The program without a process of its own: loading LibTorch anew takes a second a command line.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "process.h"

namespace patina::test {

/// What `patina` with these arguments (without its own name) says and returns. For command lines that end
/// soon; what is about a process itself (signals, streams, memory) takes run_process.
ProcessResult patina(std::vector<std::string> arguments);

/// `patina enhance` of the small kettle with four views and no turntable, as "a rusty old kettle" unless the
/// options say otherwise; they win.
ProcessResult enhance_small_kettle(const std::filesystem::path& output,
                                   const std::vector<std::string>& options);

/// Options that `patina enhance` must refuse, and what it must say of them.
struct Refusal {
  std::vector<std::string> options;
  int exit_code;
  std::vector<std::string> says;
};
/// Expects each to be refused before a view is rendered.
void expect_refused_before_rendering(const std::vector<Refusal>& refusals);

}  // namespace patina::test
