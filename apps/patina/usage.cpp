#include "usage.h"

#include <algorithm>
#include <cctype>
#include <numeric>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace patina::app {
namespace {

// Number of letters to insert, remove, replace or swap with the next one.
size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<size_t> before_last, last(b.size() + 1), row(b.size() + 1);
  std::iota(last.begin(), last.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
    before_last = std::exchange(last, row);
  }
  return last[b.size()];
}

bool takes(const CLI::App& command, const std::string& name) {
  return command.get_option_no_throw(name) != nullptr;
}

// The long option of the command that is spelt most like `name`; empty if none is near.
std::string nearest(const CLI::App& command, const std::string& name) {
  std::string best;
  size_t least = name.size() / 3 + 1;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& spelling : option->get_lnames())
      if (const size_t distance = edit_distance(name, "--" + spelling); distance < least)
        least = distance, best = "--" + spelling;
  return best;
}

}  // namespace

const CLI::App& chosen_command(const CLI::App& program) {
  const CLI::App* command = &program;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  return *command;
}

std::string about_at_command_line(const Failure& failure, const CLI::App& command) {
  const bool may_be_setting =
      failure.kind == name_of(ErrorCode::kUsage) || failure.kind == name_of(ErrorCode::kDevice);
  const std::string dashed = "--" + failure.about;
  return may_be_setting && !failure.about.empty() && takes(command, dashed) ? dashed : failure.about;
}

std::string about_unexpected(const CLI::App& program, int argc, const char* const* argv,
                             const std::string& usual) {
  const CLI::App& command = chosen_command(program);
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::string name = argument.substr(0, argument.find('='));
    if (name.size() < 2 || name[0] != '-' || takes(command, name)) continue;
    if (name[1] != '-' && (name.size() > 2 || std::isdigit(static_cast<unsigned char>(name[1]))))
      continue;  // a number, or a short option with its value
    std::vector<std::string> others;
    for (const CLI::App* other : program.get_subcommands([](const CLI::App*) { return true; }))
      if (takes(*other, name)) others.push_back("`patina " + other->get_name() + "`");
    if (!others.empty())
      return fmt::format("`patina {}` does not use {}; {} {}", command.get_name(), name,
                         fmt::join(others, ", "), others.size() == 1 ? "does" : "do");
    if (const std::string meant = nearest(command, name); !meant.empty())
      return fmt::format("there is no option {}; did you mean {}?", name, meant);
    return fmt::format("there is no option {}", name);
  }
  return usual;
}

}  // namespace patina::app
