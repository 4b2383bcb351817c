// The one list of options. The command line, the config file, config.json and the check whether a stage must
// run again are all made from it, so an option is added in one place.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/pipeline/config.h"

namespace patina::pipeline {

/// Stages as bits: which of them read an option.
enum StageBits : unsigned {
  kNoStage = 0,
  kRenderStage = 1,
  kDetailStage = 2,
  kFitStage = 4,
  kReportStage = 8,
  kEveryStage = 15,
};

struct Option {
  std::string name = {};                  // long name without dashes; also its key in files
  std::vector<std::string> aliases = {};  // other spellings with dashes: "-p", "--cfg-scale"
  std::string group = {};                 // heading in --help
  std::string placeholder = {};           // what stands for the value in --help: "TEXT", "4|9|16"
  std::string help = {};                  // one or two sentences with the unit
  std::string default_text = {};          // as --help shows it
  unsigned stages = kNoStage;             // who reads it (for showing it and for re-running)
  bool is_list = false;                   // takes several values
  bool is_flag = false;                   // needs no value on the command line: "true"

  /// Parses, checks the range and stores. Throws Error{kUsage} that states the range and what was found.
  std::function<void(Config&, std::span<const std::string> values)> set = {};
  /// The value as config.json keeps it: strings, numbers or lists, in the units of the command line.
  std::function<nlohmann::json(const Config&)> get = {};
};

/// All options in the order of --help.
const std::vector<Option>& options();

/// nullptr if there is none of that name.
const Option* find_option(std::string_view name);

/// Every option's value.
nlohmann::json to_json(const Config& config);

/// Sets the options that `json` (an object of to_json's form) holds; throws Error{kFormat} on unknown names,
/// with `context`.
void apply_json(Config& config, const nlohmann::json& json, const std::string& context);

/// The values that the given stages read: what decides whether a stage must run again.
nlohmann::json values_read_by(const Config& config, unsigned stages);

}  // namespace patina::pipeline
