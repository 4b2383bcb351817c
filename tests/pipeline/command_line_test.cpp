// The command line as a user meets it: help, exit codes, messages that say what to do, nothing left behind
// after a refusal.
#include <memory>

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

#include "in_process.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/pipeline/options.h"
#include "process.h"
#include "program.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

ProcessResult as_process(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), built_program("patina").string());
  return run_process(arguments, {.seconds = 120});
}

std::string kettle() {
  return (data_dir().parent_path().parent_path() / "examples" / "kettle.glb").string();
}
std::string model() {
  return (data_dir() / "tiny-sd").string();
}

// A run of `enhance` that must be refused with `exit_code`, a message that holds all of `words`, and no
// output.
void expect_refused(int exit_code, std::vector<std::string> arguments,
                    const std::vector<std::string>& words) {
  const TemporaryFolder folder;
  const fs::path output = folder.path() / "out.glb";
  arguments.insert(arguments.begin(), "enhance");
  if (std::find(arguments.begin(), arguments.end(), "-o") == arguments.end())
    arguments.insert(arguments.end(), {"-o", output.string()});
  const ProcessResult result = patina(arguments);
  EXPECT_EQ(result.exit_code, exit_code) << result.error;
  for (const std::string& word : words)
    EXPECT_NE(result.error.find(word), std::string::npos) << "'" << word << "' is not in: " << result.error;
  EXPECT_TRUE(fs::is_empty(folder.path())) << "neither an output nor a run folder";
}

TEST(CommandLine, help_explains_every_option) {
  const std::unique_ptr<CLI::App> program = app::make_program();
  const std::string help = program->get_subcommand("enhance")->help();
  for (const pipeline::Option& option : pipeline::options()) {
    EXPECT_NE(help.find("--" + option.name), std::string::npos) << option.name;
    EXPECT_NE(help.find(option.group + ":"), std::string::npos) << option.group;
  }
  EXPECT_EQ(help.find(":{"), std::string::npos) << "choices are listed once";
  size_t num_options = 0;
  for (const CLI::App* command : program->get_subcommands([](const CLI::App*) { return true; })) {
    EXPECT_FALSE(command->get_description().empty()) << command->get_name();
    for (const CLI::Option* option : command->get_options()) {
      EXPECT_FALSE(option->get_description().empty()) << command->get_name() << " " << option->get_name();
      ++num_options;
    }
  }
  EXPECT_GT(num_options, 5 * pipeline::options().size() / 2) << "the commands share most of them";
}

TEST(CommandLine, help_and_version_go_to_standard_output) {
  const ProcessResult help = as_process({"report", "--help"}), version = as_process({"--version"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_NE(help.output.find("--turntable"), std::string::npos) << help.output;
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_TRUE(version.output.starts_with("patina ")) << version.output;
}

TEST(CommandLine, wrong_usage_is_exit_code_2) {
  EXPECT_EQ(as_process({}).exit_code, 2);
  EXPECT_EQ(patina({"polish", "a.glb"}).exit_code, 2);
  EXPECT_EQ(patina({"enhance"}).exit_code, 2);
  EXPECT_EQ(patina({"enhance", kettle(), "--colour", "red"}).exit_code, 2);
  expect_refused(2, {kettle()}, {"--prompt"});
  expect_refused(2, {kettle(), "-p", "rust", "--views", "5"}, {"--views", "4, 9 or 16", "'5'"});
  expect_refused(2, {kettle(), "-p", "rust", "--strength", "1.5"}, {"--strength", "0.01 to 1"});
  expect_refused(2, {kettle(), "-p", "rust", "--strength", "0.5", "--strength", "7"},
                 {"'7'"});  // the last wins
  expect_refused(2, {kettle(), "-p", "rust", "-m", model(), "--resolution", "100", "--bias", "0"},
                 {"--resolution", "multiple of 8"});
  expect_refused(2, {kettle(), "-p", "rust", "-m", model(), "--resolution", "72", "--bias", "1"},
                 {"--resolution", "multiple of 64"});
  expect_refused(2, {kettle(), "-p", "rust", "-m", model(), "--material", "rubber duck"},
                 {"rubber duck", "it has"});
}

// Those that are not in the pipeline's list, too.
TEST(CommandLine, a_wrong_number_is_answered_with_what_was_expected) {
  const auto expect = [](const std::string& option, const std::string& given) {
    try {
      app::make_program()->parse("show-attention a.glb -p rust -o a.html " + option + " " + given);
      ADD_FAILURE() << option << " " << given << " is accepted";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kUsage);
      EXPECT_EQ("--" + e.context(), option);
      EXPECT_EQ(e.message(), "expected a whole number of 1 or more, found '" + given + "'");
    }
  };
  expect("--view", "first");
  expect("--view", "0");
  expect("--step", "1.5");
}

TEST(CommandLine, options_that_a_command_does_not_use_are_refused_by_name) {
  const TemporaryFolder folder;
  const std::string run = folder.path().string();
  const auto expect = [](const std::vector<std::string>& arguments, const std::vector<std::string>& words) {
    const ProcessResult result = patina(arguments);
    EXPECT_EQ(result.exit_code, 2) << result.error;
    for (const std::string& word : words)
      EXPECT_NE(result.error.find(word), std::string::npos) << word << " is not in: " << result.error;
  };
  expect({"report", run, "-o", "x.glb"}, {"`patina report` does not use -o", "`patina fit`"});
  expect({"report", run, "--environment", "sky.hdr"}, {"does not use --environment"});
  expect({"detail", run, "--output=x.glb"}, {"`patina detail` does not use --output"});
  expect({"detail", run, "--views", "4"}, {"does not use --views", "`patina render`"});
  expect({"fit", run, "--low-memory"}, {"does not use --low-memory"});
  expect({"render", kettle(), "-p", "rust"}, {"does not use -p"});
}

TEST(CommandLine, a_misspelt_option_is_answered_with_what_was_meant) {
  const auto expect = [](const std::string& given, const std::string& meant) {
    const ProcessResult result = patina({"enhance", "a.glb", given, "1"});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_NE(result.error.find("did you mean " + meant + "?"), std::string::npos) << result.error;
  };
  expect("--promt", "--prompt");
  expect("--strenght", "--strength");
  expect("--fit-iteration", "--fit-iterations");
  expect("--guidance_scale", "--guidance-scale");
  const ProcessResult far = patina({"enhance", "a.glb", "--colour-of-the-sky", "1"});
  EXPECT_EQ(far.error.find("did you mean"), std::string::npos) << far.error;
  EXPECT_NE(far.error.find("there is no option --colour-of-the-sky"), std::string::npos) << far.error;
}

TEST(CommandLine, a_config_file_may_hold_options_of_other_commands) {
  const TemporaryFolder folder;
  write_file(folder.path() / "all.toml", std::string_view("prompt = \"moss\"\nviews = 4\nturntable = 3\n"));
  const ProcessResult result = patina(
      {"report", (folder.path() / "none").string(), "--config", (folder.path() / "all.toml").string()});
  EXPECT_EQ(result.exit_code, 1) << result.error;  // there is no such run folder
}

TEST(CommandLine, missing_and_wrong_inputs_are_named) {
  const TemporaryFolder folder;
  expect_refused(1, {"no-such.glb", "-p", "rust", "-m", model()}, {"no-such.glb", "no such file"});
  const fs::path text = folder.path() / "text.glb";
  write_file(text, std::string_view("this is no asset"));
  expect_refused(1, {text.string(), "-p", "rust", "-m", model()}, {"text.glb"});
  expect_refused(1, {kettle(), "-p", "rust", "-m", model(), "--environment", text.string()}, {"text.glb"});
  expect_refused(1, {kettle(), "-p", "rust", "-m", model(), "--cameras", text.string()},
                 {"text.glb", "JSON"});
  expect_refused(1, {kettle(), "-p", "rust", "-m", model(), "--scene", text.string()}, {"text.glb"});
}

TEST(CommandLine, wrong_models_are_refused_before_anything_is_rendered) {
  const TemporaryFolder folder;
  expect_refused(1, {kettle(), "-p", "rust", "-m", (folder.path() / "none").string()}, {"none"});
  write_file(folder.path() / "model.ckpt", std::string_view("\x80\x02}q"));
  expect_refused(1, {kettle(), "-p", "rust", "-m", (folder.path() / "model.ckpt").string()},
                 {"model.ckpt", "code"});
}

TEST(CommandLine, unwritable_output_is_refused_first) {
  const TemporaryFolder folder;
  write_file(folder.path() / "file", std::string_view("x"));
  expect_refused(1,
                 {kettle(), "-p", "rust", "-m", model(), "-o", (folder.path() / "file" / "out.glb").string()},
                 {"file"});
  expect_refused(2, {kettle(), "-p", "rust", "-m", model(), "-o", (folder.path() / "out.fbx").string()},
                 {".glb"});
}

TEST(CommandLine, a_config_file_holds_options_and_the_command_line_wins) {
  const TemporaryFolder folder;
  const fs::path config = folder.path() / "config.toml";
  write_file(config, std::string_view("prompt = \"moss\"\nviews = 5\n"));
  expect_refused(2, {kettle(), "--config", config.string()}, {"--views", "'5'"});
  write_file(config, std::string_view("prompt = \"moss\"\nstrength = 0.5\nelevation = [10, 30]\n"));
  expect_refused(2, {kettle(), "--config", config.string(), "--strength", "7"}, {"--strength", "'7'"});
  write_file(config, std::string_view("prompt = \"moss\"\nbias-controlnet = 2\n"));
  expect_refused(2, {kettle(), "--config", config.string()}, {"--bias-controlnet", "true or false"});
  // A flag needs no value.
  expect_refused(1, {kettle(), "-p", "moss", "--bias-controlnet", "-m", "none"}, {"none"});
  write_file(config, std::string_view("colour = \"red\"\n"));
  expect_refused(2, {kettle(), "--config", config.string()}, {"colour", "config.toml"});
  write_file(config, std::string_view("[[[\n"));
  expect_refused(2, {kettle(), "--config", config.string()}, {"config.toml"});
  expect_refused(1, {kettle(), "--config", "missing.toml"}, {"missing.toml"});
}

TEST(CommandLine, a_comparison_wants_two_finished_runs_and_nothing_to_run) {
  const TemporaryFolder folder;
  const std::string run = folder.path().string();
  const auto expect = [](int exit_code, const std::vector<std::string>& arguments, const std::string& words) {
    const ProcessResult result = patina(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.error;
    EXPECT_NE(result.error.find(words), std::string::npos) << words << " is not in: " << result.error;
  };
  expect(2, {"report", "--compare", run}, "two run folders or more");
  expect(2, {"report", run, "--page", "x.html"}, "is for --compare");
  expect(2, {"report", "--seed", "1", "--compare", run, run}, "has no effect with --compare");
  expect(1, {"report", "--compare", run, run}, "is not a run folder");
  write_file(folder.path() / "config.json", std::string_view("{}"));
  write_file(folder.path() / "stages.json", std::string_view("[]"));
  expect(1, {"report", run, "--compare", run}, "has no report yet");
}

TEST(CommandLine, stages_say_what_comes_first) {
  const TemporaryFolder folder;
  const ProcessResult result = as_process({"detail", folder.path().string()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.error.find("patina render"), std::string::npos) << result.error;
}

}  // namespace
}  // namespace patina::test
