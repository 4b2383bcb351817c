// The one list of options. The command line, config files and config.json are all made from it, so an option
// is added in one place: the table of its group (option_groups.h), and the field in settings.h or config.h.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/pipeline/config.h"

namespace patina::pipeline {

/// What an option belongs to, as bits: the input files, or the stages in whose settings it is written.
/// Commands take the options of what they run.
enum Part : unsigned {
  kInputs = 1,
  kRender = 2,
  kEdit = 4,
  kFit = 8,
  kReport = 16,
  kOutput = 32,   // the enhanced asset
  kMachine = 64,  // every command
  kMasks = 128,   // where the asset may change
  kEverything = 255,
};

/// How a text becomes a typed value.
enum class ValueKind { kText, kInteger, kNumber, kTruth };

struct Option {
  std::string name;                   // long name without dashes; also its key in files
  std::vector<std::string> aliases;   // other spellings with dashes: "-p", "--cfg-scale"
  std::string group;                  // heading in --help
  std::string placeholder;            // what stands for the value in --help: "TEXT", "4|9|16"
  std::string help;                   // one or two sentences with the unit
  std::string default_text;           // as --help shows it
  unsigned parts = 0;                 // who reads it
  ValueKind kind = ValueKind::kText;  // of one value
  std::string word;                   // may stand in place of a number: "auto"; empty: none
  std::string expected;               // for messages: "a number from 0.01 to 1"
  bool is_list = false;               // takes several values
  bool splits_at_commas = false;      // of a list: "20,50" is two values

  /// Stores a value of get's form: text, number or truth value, or a list of them. Throws Error{kUsage} with
  /// the option's name as context, which says what was expected and what was found.
  std::function<void(Config&, const nlohmann::json& value)> set;
  /// The value as config.json keeps it, in the units of the command line.
  std::function<nlohmann::json(const Config&)> get;

  bool is_flag() const { return kind == ValueKind::kTruth; }
};

/// All options in the order of --help.
const std::vector<Option>& options();

/// nullptr if there is none of that name.
const Option* find_option(std::string_view name);

/// The typed value of what was written on a command line or in a file. Throws as Option::set.
nlohmann::json value_of_texts(const Option& option, std::span<const std::string> texts);

/// Every option's value.
nlohmann::json to_json(const Config& config);

/// Sets the options that `json` (an object of to_json's form) holds; throws Error{kFormat} on unknown names,
/// with `context`.
void apply_json(Config& config, const nlohmann::json& json, const std::string& context);

}  // namespace patina::pipeline
