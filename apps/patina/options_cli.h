// The pipeline's list of options on a CLI11 command, and the order in which they win: command line, config
// file, run folder, default.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "patina/pipeline/config.h"

namespace patina::app {

/// What a command was given. Lives as long as the command is parsed.
struct GivenOptions {
  std::vector<std::pair<std::string, CLI::Option*>> options;  // name in the pipeline's list, CLI11's option
  std::string config_file;
  bool quiet = false;
};

/// Adds the options that the given stages read (all with ~0u) but for those named in `without`, and --config
/// and --quiet.
std::shared_ptr<GivenOptions> add_options(CLI::App& command, unsigned stages,
                                          const std::vector<std::string>& without = {});

/// Sets on `config` first what the config file holds, then what the command line holds. Throws Error{kUsage}.
void apply_options(const GivenOptions& given, pipeline::Config& config);

/// Throws Error{kUsage} unless there is a prompt.
void require_prompt(const pipeline::Config& config);

}  // namespace patina::app
