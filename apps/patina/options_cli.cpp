#include "options_cli.h"

#include <algorithm>
#include <filesystem>
#include <sstream>

#include <fmt/format.h>

#include "bundled_model.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/pipeline/options.h"

namespace patina::app {
namespace {

// "-p,--prompt", but "--guidance-scale,--cfg-scale".
std::string all_names(const pipeline::Option& option) {
  std::string short_names, long_names = "--" + option.name;
  for (const std::string& alias : option.aliases)
    if (alias.starts_with("--"))
      long_names.append(",").append(alias);
    else
      short_names.append(alias).append(",");
  return short_names + long_names;
}

// Values stay text here: the pipeline's list parses them, the same way wherever they come from.
void add_option(CLI::App& command, const pipeline::Option& option, GivenOptions& given) {
  GivenOptions::Item& item = given.items.emplace_back(GivenOptions::Item{.name = option.name});
  // const, because CLI11 takes a string that it may change for the variable that the option fills.
  const std::string names = all_names(option),
                    help = option.default_text.empty()
                               ? option.help
                               : fmt::format("{} [{}]", option.help, option.default_text);
  if (option.is_flag()) {
    item.cli = command.add_flag(names, help);
  } else if (option.is_list) {
    item.cli =
        command.add_option(names, item.values, help)->type_name(option.placeholder);  // CLI11 adds "..."
  } else {
    item.cli = command.add_option(names, help)->type_name(option.placeholder)->expected(1);
  }
  item.cli->group(option.group);
  if (!option.is_list) item.cli->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
}

// TOML with every list on one line and without the comments in it: CLI11 reads no others.
std::string with_lists_on_one_line(const std::string& toml) {
  std::string joined;
  int depth = 0;
  char quote = 0;
  for (size_t i = 0; i < toml.size(); ++i) {
    const char c = toml[i];
    if (quote) {
      if (c == quote && (quote == '\'' || toml[i - 1] != '\\')) quote = 0;
    } else if (c == '#') {
      while (i + 1 < toml.size() && toml[i + 1] != '\n') ++i;
      continue;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '[' || c == ']') {
      depth += c == '[' ? 1 : -1;
    }
    joined += depth > 0 && !quote && c == '\n' ? ' ' : c;
  }
  return joined;
}

// Options by name from a TOML file; options of other commands are left to them.
void apply_file(const GivenOptions& given, pipeline::Config& config) {
  std::istringstream text(with_lists_on_one_line(read_text_file(given.config_file, 1 << 20)));
  std::vector<CLI::ConfigItem> items;
  try {
    items = CLI::ConfigTOML().from_config(text);
  } catch (const CLI::Error& e) {
    throw Error(ErrorCode::kUsage, given.config_file, fmt::format("is not valid TOML: {}", e.what()));
  }
  for (const CLI::ConfigItem& item : items) {
    const pipeline::Option* option = pipeline::find_option(item.name);
    if (!option || !item.parents.empty())
      throw Error(
          ErrorCode::kUsage, given.config_file,
          fmt::format("unknown option '{}'; `patina enhance --help` lists them, without the dashes here",
                      printable(item.fullname())));
    if (item.inputs.empty())
      throw Error(ErrorCode::kUsage, given.config_file, fmt::format("'{}' has no value", item.name));
  }
  // In the order of the list, not of the file: a preset comes before what it would else overwrite.
  for (const GivenOptions::Item& own : given.items)
    for (const CLI::ConfigItem& item : items)
      if (item.name == own.name) {
        const pipeline::Option& option = *pipeline::find_option(own.name);
        option.set(config, pipeline::value_of_texts(option, item.inputs));
      }
}

}  // namespace

Style GivenOptions::style() const {
  if (progress == "json") return quiet ? Style::kQuietJson : Style::kJson;
  return quiet ? Style::kQuiet : Style::kPlain;
}

std::shared_ptr<GivenOptions> add_options(CLI::App& command, const std::string& positional,
                                          const std::string& positional_help, unsigned parts,
                                          const std::vector<std::string>& without) {
  auto given = std::make_shared<GivenOptions>();
  given->positional_name = positional;
  command.add_option(positional, given->positional, positional_help)->type_name("");
  for (const pipeline::Option& option : pipeline::options())
    if ((option.parts & parts) && std::find(without.begin(), without.end(), option.name) == without.end())
      add_option(command, option, *given);
  command
      .add_option("--config", given->config_file,
                  "A TOML file with any of these options by name; the command line wins.")
      ->type_name("FILE.toml")
      ->group("Input and output");
  command
      .add_option("--progress", given->progress,
                  "How progress is told on standard error: plain for people, json for programs, one event a "
                  "line (docs/progress.md). [plain]")
      ->type_name("plain|json")
      ->check(CLI::IsMember({"plain", "json"}).description(""))  // the type name says it
      ->group("Machine");
  command.add_flag("-q,--quiet", given->quiet, "No progress and no notes; errors still show.")
      ->group("Machine");
  return given;
}

void apply_options(const GivenOptions& given, pipeline::Config& config) {
  config.bundled_model = bundled_model();
  if (!given.config_file.empty()) apply_file(given, config);
  for (const GivenOptions::Item& item : given.items) {
    if (item.cli->count() == 0) continue;
    const pipeline::Option& option = *pipeline::find_option(item.name);
    const std::vector<std::string> texts = option.is_list ? item.values : item.cli->reduced_results();
    option.set(config, pipeline::value_of_texts(option, texts));
  }
}

void find_positional(GivenOptions& given) {
  if (!given.positional.empty()) return;
  for (GivenOptions::Item& item : given.items) {
    if (item.values.size() < 2 || !std::filesystem::exists(item.values.back())) continue;
    given.positional = item.values.back();
    item.values.pop_back();
    return;
  }
  throw Error(ErrorCode::kUsage, given.positional_name, "is missing; give it first, before all options");
}

int parse_count(const std::string& setting, const std::string& text) {
  const auto count = parse_number<int>(text);
  if (count && *count >= 1) return *count;
  throw Error(ErrorCode::kUsage, setting,
              fmt::format("expected a whole number of 1 or more, found '{}'", printable(text)));
}

void require_prompt(const pipeline::Config& config) {
  if (config.edit.options.prompt.find_first_not_of(" \t\r\n") == std::string::npos)
    throw Error(ErrorCode::kUsage, "prompt",
                "say what the asset should look like, e.g. --prompt \"a rusty old kettle\"");
}

}  // namespace patina::app
