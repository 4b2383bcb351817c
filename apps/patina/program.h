// The command line of patina as an object: its subcommands and what each of them takes.
#pragma once

#include <memory>

#include <CLI/CLI.hpp>

namespace patina::app {

/// Parsing a command line runs the subcommand that it names.
std::unique_ptr<CLI::App> make_program();

}  // namespace patina::app
