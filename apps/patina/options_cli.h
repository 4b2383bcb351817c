// The pipeline's list of options on a CLI11 command, and the order in which they win: command line, config
// file, run folder, default.
#pragma once

#include <list>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "console.h"
#include "patina/pipeline/config.h"

namespace patina::app {

/// What a command was given. Lives as long as the command is parsed.
struct GivenOptions {
  struct Item {
    std::string name;                      // in the pipeline's list
    CLI::Option* cli = nullptr;            // CLI11's
    std::vector<std::string> values = {};  // of an option that takes several
  };
  std::list<Item> items;  // CLI11 keeps pointers to `values`
  std::string positional_name, positional;
  std::string config_file, progress;
  bool quiet = false;

  Style style() const;
};

/// Adds the command's one positional argument ("ASSET", "RUN"), the options of `parts` (pipeline::Part) but
/// for those named in `without` (which may name "config" too), and --config, --progress and --quiet.
std::shared_ptr<GivenOptions> add_options(CLI::App& command, const std::string& positional,
                                          const std::string& positional_help, unsigned parts,
                                          const std::vector<std::string>& without = {});

/// Sets on `config` first what the config file holds for this command, then what the command line holds.
/// Throws Error{kUsage}.
void apply_options(const GivenOptions& given, pipeline::Config& config);

/// Gives the positional argument back that an option with several values before it took for one of its own.
/// Throws Error{kUsage} where it is missing. To be called before apply_options.
void find_positional(GivenOptions& given);

/// A whole number of 1 or more for a setting that is not in the pipeline's list. Throws Error{kUsage}.
int parse_count(const std::string& setting, const std::string& text);

/// Throws Error{kUsage} unless there is a prompt.
void require_prompt(const pipeline::Config& config);

}  // namespace patina::app
