// The program without a process of its own: loading LibTorch anew takes a second a command line.
#pragma once

#include <string>
#include <vector>

#include "process.h"

namespace patina::test {

/// What `patina` with these arguments (without its own name) says and returns. For command lines that end
/// soon; what is about a process itself (signals, streams, memory) takes run_process.
ProcessResult patina(std::vector<std::string> arguments);

}  // namespace patina::test
