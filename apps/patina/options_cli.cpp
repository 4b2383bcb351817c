#include "options_cli.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "bundled_model.h"
#include "patina/base/error.h"
#include "patina/base/text.h"
#include "patina/pipeline/options.h"
#include "toml_options.h"

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

// Options by name from a TOML file; options of other commands are left to them.
void apply_file(const GivenOptions& given, pipeline::Config& config) {
  const toml::table file = read_toml(given.config_file);
  const std::vector<TomlOption> found = options_of(file, given.config_file, ErrorCode::kUsage);
  // In the order of the list, not of the file: a preset comes before what it would else overwrite.
  for (const GivenOptions::Item& own : given.items)
    for (const TomlOption& one : found)
      if (one.option->name == own.name)
        one.option->set(config, pipeline::value_of_texts(*one.option, one.texts));
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
  const bool takes_config = std::find(without.begin(), without.end(), "config") == without.end();
  if (takes_config)
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
