// Every command line that README, docs and help texts show is understood by the program.
#include <wordexp.h>

#include <regex>
#include <sstream>

#include <gtest/gtest.h>

#include "in_process.h"
#include "patina/base/files.h"
#include "patina/pipeline/options.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

struct Example {
  std::string place, command;
};

// Lines of code blocks that call patina, without comments; a backslash at the end continues a line.
std::vector<Example> examples_of(const fs::path& page) {
  static const std::regex call(R"(^(?:    )?(?:build/release/)?patina ([a-z].*)$)");
  std::vector<Example> examples;
  std::istringstream lines(read_text_file(page));
  int number = 0;
  bool fenced = false;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.starts_with("```")) fenced = !fenced;
    if (!fenced && !line.starts_with("    ")) continue;
    for (std::string rest; line.ends_with('\\') && std::getline(lines, rest); ++number)
      line = line.substr(0, line.size() - 1) + rest;
    std::smatch match;
    if (!std::regex_match(line, match, call)) continue;
    std::string command = match[1];
    if (const size_t comment = command.find(" # "); comment != std::string::npos) command.resize(comment);
    if (const size_t left_out = command.find("…"); left_out != std::string::npos)
      command.replace(left_out, std::string("…").size(), "kettle.glb");
    examples.push_back({page.filename().string() + ":" + std::to_string(number), command});
  }
  return examples;
}

// What the program says of a command line where no file exists: 1, since it looks for the files once it has
// understood the rest.
ProcessResult tried(const std::string& command) {
  wordexp_t words{};
  const int refused = ::wordexp(command.c_str(), &words, WRDE_NOCMD);  // as a shell takes it apart
  EXPECT_EQ(refused, 0) << command;
  std::vector<std::string> arguments;
  if (refused == 0) arguments.assign(words.we_wordv, words.we_wordv + words.we_wordc);
  if (refused == 0) ::wordfree(&words);
  const TemporaryFolder empty;
  const fs::path here = fs::current_path();
  fs::current_path(empty.path());
  const ProcessResult result = patina(arguments);
  fs::current_path(here);
  return result;
}

TEST(Examples, of_readme_and_docs_are_understood) {
  const fs::path root = data_dir().parent_path().parent_path();
  std::vector<fs::path> pages{root / "README.md"};
  for (const auto& entry : fs::directory_iterator(root / "docs"))
    if (entry.path().extension() == ".md") pages.push_back(entry.path());
  size_t num_examples = 0;
  for (const fs::path& page : pages)
    for (const Example& example : examples_of(page)) {
      const ProcessResult result = tried(example.command);
      EXPECT_EQ(result.exit_code, 1) << example.place << ": " << example.command << "\n" << result.error;
      ++num_examples;
    }
  EXPECT_GE(num_examples, 20u);
}

TEST(Examples, of_help_texts_are_understood) {
  static const std::regex shown(R"(e\.g\. (--[a-z-]+(?: [-\w]+)+))");
  size_t num_examples = 0;
  for (const pipeline::Option& option : pipeline::options()) {
    std::smatch match;
    if (!std::regex_search(option.help, match, shown)) continue;
    const ProcessResult result = tried("enhance kettle.glb -p moss -o out.glb " + match[1].str());
    EXPECT_EQ(result.exit_code, 1) << match[1] << "\n" << result.error;
    ++num_examples;
  }
  EXPECT_GE(num_examples, 1u);
}

TEST(Examples, several_values_are_taken_before_and_after_the_asset) {
  const std::string kettle = (data_dir().parent_path().parent_path() / "examples" / "kettle.glb").string();
  const std::string rest = " -p moss -m none -o out.glb";
  for (const std::string several :
       {"--elevation -20 20 50", "--elevation 20,50", "--elevation 20 --elevation 50",
        "--fit base_color roughness normal metallic", "--fit base_color,roughness", "--material enamel wood",
        "--material enamel,wood", "--lora a:0.5 b", "--elevation 10 --fit normal"}) {
    for (const std::string& command :
         {"enhance " + kettle + " " + several + rest, "enhance" + rest + " " + several + " " + kettle,
          "enhance " + several + " " + kettle + rest}) {
      const ProcessResult result = tried(command);
      EXPECT_EQ(result.exit_code, 1) << command << "\n" << result.error;
      EXPECT_NE(result.error.find("none: "), std::string::npos) << command << "\n" << result.error;
    }
  }
}

}  // namespace
}  // namespace patina::test
