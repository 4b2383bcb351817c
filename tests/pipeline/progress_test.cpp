// --progress json: every line on standard error is one event of docs/progress.md, and standard streams that
// cannot be written stop nothing.
#include <map>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "in_process.h"
#include "patina/base/files.h"
#include "process.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

fs::path repository() {
  return data_dir().parent_path().parent_path();
}

std::vector<std::string> enhance_command(const fs::path& output) {
  return {built_program("patina").string(),
          "enhance",
          small_kettle().string(),
          "-p",
          "a rusty old kettle",
          "-m",
          (data_dir() / "tiny-sd").string(),
          "--views",
          "1",
          "--resolution",
          "64",
          "--samples",
          "1",
          "--max-depth",
          "1",
          "--elevation",
          "-80",  // sees little, which is a warning
          "-s",
          "1",
          "--fit-iterations",
          "2",
          "--texture-size",
          "32",
          "--light-samples",
          "4",
          "--turntable",
          "1",
          "-o",
          output.string()};
}

std::vector<json> events_of(const std::string& text) {
  std::vector<json> events;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    events.push_back(json::parse(line, nullptr, /*allow_exceptions=*/false));
    EXPECT_TRUE(events.back().is_object()) << line;
  }
  return events;
}

// The fields of each event, as the table of docs/progress.md lists them: | `event` | `field` `field` | ... |
std::map<std::string, std::set<std::string>> documented_events() {
  std::map<std::string, std::set<std::string>> table;
  std::istringstream lines(read_text_file(repository() / "docs" / "progress.md"));
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("| `")) continue;
    std::vector<std::string> words;  // between backticks
    for (size_t begin = 0; (begin = line.find('`', begin)) != line.npos;) {
      const size_t end = line.find('`', begin + 1);
      words.push_back(line.substr(begin + 1, end - begin - 1));
      begin = end + 1;
    }
    if (words[0] == "event") continue;
    table[words[0]] = {words.begin() + 1, words.end()};
  }
  return table;
}

void expect_documented(const std::vector<json>& events) {
  const auto table = documented_events();
  for (const json& event : events) {
    const auto known = table.find(event.at("event").get<std::string>());
    ASSERT_NE(known, table.end()) << event;
    for (const auto& [field, value] : event.items())
      EXPECT_TRUE(field == "event" || known->second.count(field)) << event;
  }
}

TEST(Progress, json_tells_stages_progress_previews_warnings_and_the_result) {
  const TemporaryFolder folder;
  std::vector<std::string> command = enhance_command(folder.path() / "out.glb");
  command.insert(command.end(), {"--progress", "json"});
  const ProcessResult result = run_process(command, {.seconds = 300});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const std::vector<json> events = events_of(result.error);
  expect_documented(events);

  std::map<std::string, int> count;
  std::vector<std::string> stages;
  for (const json& event : events) {
    ++count[event.at("event")];
    if (event.at("event") == "stage")
      stages.push_back(event.at("stage").get<std::string>() + " " + event.at("state").get<std::string>());
    if (event.at("event") == "progress") {
      EXPECT_GE(event.at("share").get<double>(), 0);
      EXPECT_LE(event.at("share").get<double>(), 1);
      EXPECT_TRUE(event.at("seconds_left").is_null() || event.at("seconds_left").get<double>() >= 0);
      EXPECT_FALSE(event.at("stage").get<std::string>().empty()) << event;
    }
    if (event.at("event") == "preview") {
      EXPECT_TRUE(fs::exists(event.at("file").get<std::string>())) << event;
    }
  }
  EXPECT_EQ(stages, (std::vector<std::string>{"render started", "render finished", "detail started",
                                              "detail finished", "fit started", "fit finished",
                                              "report started", "report finished"}));
  for (const char* kind : {"progress", "preview", "warning"}) EXPECT_GT(count[kind], 0) << kind;
  EXPECT_EQ(count["result"], 1);
  const json& last = events.back();
  EXPECT_EQ(last.at("event"), "result");
  EXPECT_EQ(last.at("asset"), (folder.path() / "out.glb").string());
  EXPECT_TRUE(fs::exists(last.at("report").get<std::string>()));

  // The same once more: nothing to do.
  const std::vector<json> again = events_of(run_process(command, {.seconds = 300}).error);
  size_t reused = 0;
  for (const json& event : again) reused += event.value("state", "") == "reused";
  EXPECT_EQ(reused, 4u);
}

TEST(Progress, json_tells_failures_of_usage_and_of_files) {
  const auto last_event = [](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--progress", "json"});
    const ProcessResult result = patina(arguments);
    const std::vector<json> events = events_of(result.error);
    expect_documented(events);
    EXPECT_FALSE(events.empty());
    if (events.empty()) return json();
    EXPECT_EQ(events.back().at("exit_code"), result.exit_code);
    return events.back();
  };
  const json range = last_event({"enhance", "a.glb", "-p", "rust", "--views", "5", "-o", "b.glb"});
  EXPECT_EQ(range.at("event"), "error");
  EXPECT_EQ(range.at("kind"), "usage");
  EXPECT_EQ(range.at("about"), "--views");
  EXPECT_EQ(range.at("exit_code"), 2);
  const json missing = last_event({"render", "no-such.glb", "--run", "/tmp/patina-none/run"});
  EXPECT_EQ(missing.at("kind"), "not found");
  EXPECT_EQ(missing.at("about"), "no-such.glb");
  EXPECT_EQ(last_event({"enhance", "--promt", "rust"}).at("kind"), "usage");
}

TEST(Progress, an_error_stream_that_cannot_be_written_stops_nothing) {
  for (const std::string redirection : {"2>/dev/full", "2>&-"}) {
    SCOPED_TRACE(redirection);
    const TemporaryFolder folder;
    std::string line;
    for (const std::string& word : enhance_command(folder.path() / "out.glb")) line += "'" + word + "' ";
    const ProcessResult result = run_process({"/bin/sh", "-c", line + redirection}, {.seconds = 300});
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_TRUE(fs::exists(folder.path() / "out.glb"));
    EXPECT_EQ(fs::file_size(folder.path() / "out.patina-run" / ".lock"), 0u);
  }
}

}  // namespace
}  // namespace patina::test
