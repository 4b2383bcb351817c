// What main() of a tool or a benchmark does: reads the command line, runs, and says what went wrong.
#pragma once

#include <functional>

#include <CLI/CLI.hpp>

namespace patina::tools {

/// Parses the command line and calls `work`; subcommands bring their work as their callback. Errors go to
/// standard error under the program's name. The exit code: 0, 1 where the work failed, 2 where the command
/// line is wrong.
int run_program(CLI::App& program, int argc, char** argv, const std::function<void()>& work = {});

}  // namespace patina::tools
