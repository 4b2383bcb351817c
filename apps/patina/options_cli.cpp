#include "options_cli.h"

#include <algorithm>
#include <sstream>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/pipeline/bundled_model.h"
#include "patina/pipeline/options.h"

namespace patina::app {

std::shared_ptr<GivenOptions> add_options(CLI::App& command, unsigned stages,
                                          const std::vector<std::string>& without) {
  auto given = std::make_shared<GivenOptions>();
  for (const pipeline::Option& option : pipeline::options()) {
    if (stages != ~0u && option.stages != pipeline::kNoStage && !(option.stages & stages)) continue;
    if (std::find(without.begin(), without.end(), option.name) != without.end()) continue;
    std::string names = "--" + option.name;
    for (const std::string& alias : option.aliases)  // -p,--prompt but --guidance-scale,--cfg-scale
      names = alias.starts_with("--") ? names + "," + alias : alias + "," + names;
    // const, since CLI11 takes a string that it may change for the variable that the option shall fill.
    const std::string help =
        option.default_text.empty() ? option.help : fmt::format("{} [{}]", option.help, option.default_text);
    // Values stay text here: the pipeline's list parses them, the same way wherever they come from.
    CLI::Option* cli;
    if (option.is_flag) {
      cli = command.add_flag(names, help);
    } else {
      cli = command.add_option(names, help)->type_name(option.placeholder);
      cli->expected(1, option.is_list ? CLI::detail::expected_max_vector_size : 1);
    }
    cli->group(option.group);
    if (!option.is_list) cli->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    given->options.emplace_back(option.name, cli);
  }
  command
      .add_option("--config", given->config_file,
                  "A TOML file with any of these options by name; the command line wins.")
      ->type_name("FILE.toml")
      ->group("Input and output");
  command.add_flag("-q,--quiet", given->quiet, "No progress and no notes; errors still show.")
      ->group("Machine");
  return given;
}

void apply_options(const GivenOptions& given, pipeline::Config& config) {
  if (!given.config_file.empty()) {
    std::istringstream text(read_text_file(given.config_file, 1 << 20));
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
    for (const pipeline::Option& option : pipeline::options())
      for (const CLI::ConfigItem& item : items)
        if (item.name == option.name) option.set(config, item.inputs);
  }
  for (const auto& [name, cli] : given.options)
    if (cli->count() > 0) pipeline::find_option(name)->set(config, cli->reduced_results());
  pipeline::settle(config);
}

void require_prompt(const pipeline::Config& config) {
  if (config.detail.prompt.empty())
    throw Error(ErrorCode::kUsage, "--prompt",
                "say what the asset shall look like, e.g. --prompt \"a rusty old kettle\"");
}

}  // namespace patina::app
