// Options by name in a TOML table, as config files and job files hold them; values mean what they mean on the
// command line.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <toml++/toml.h>

#include "patina/base/error.h"
#include "patina/pipeline/options.h"

namespace patina::app {

/// A file of at most a mebibyte. Throws Error{kNotFound, kIo}, and Error{kUsage} that names the line where it
/// is no TOML.
toml::table read_toml(const std::filesystem::path& file);

/// "jobs.toml:12", for messages.
std::string place_of(const std::string& file, const toml::node& node);

/// Text, number or truth value as the command line would spell it, or a list of them: one text a value. Empty
/// for dates and tables.
std::vector<std::string> texts_of(const toml::node& node);

/// An option that a table gives, with its value as texts for value_of_texts().
struct TomlOption {
  const pipeline::Option* option;
  std::vector<std::string> texts;
  std::string place;
};

/// All options of the table in its order. Throws Error{code} that names the file and the line for what is no
/// option or has no value.
std::vector<TomlOption> options_of(const toml::table& table, const std::string& file, ErrorCode code);

}  // namespace patina::app
