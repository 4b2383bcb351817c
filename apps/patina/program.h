// The command line of patina as an object: its subcommands and what each of them takes.
#pragma once

#include <memory>

#include <CLI/CLI.hpp>

namespace patina::app {

/// Parsing a command line runs the subcommand that it names.
std::unique_ptr<CLI::App> make_program();

/// Runs a command line as main() gets it. What went wrong is told on standard error. Returns the exit code: 0
/// done, 1 failed, 2 wrong usage, 130 stopped by the user.
int run_program(int argc, char** argv);

/// Lets the process say in one line why it ends, with exit code 1, where an exception leaves a thread.
void say_why_when_terminated();

}  // namespace patina::app
