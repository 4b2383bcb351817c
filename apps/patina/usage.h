// How failures are told at the command line, where settings are written with dashes.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "patina/base/failure.h"

namespace patina::app {

/// The subcommand that the command line chose; the program itself where it chose none.
const CLI::App& chosen_command(const CLI::App& program);

/// The name before the message: "--resolution" for a setting of the command, else what the failure is about
/// as it is.
std::string about_at_command_line(const Failure& failure, const CLI::App& command);

/// What to say of arguments that the command does not take: which commands do, or what may have been meant.
std::string about_unexpected(const CLI::App& program, int argc, const char* const* argv,
                             const std::string& usual);

}  // namespace patina::app
