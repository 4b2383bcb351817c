// Every file of the collection of bad inputs that is an asset, an image or an environment gets what its
// manifest says: an answer or a clear refusal, in bounded time and memory, without a crash.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <future>
#include <map>
#include <sstream>

#include <gtest/gtest.h>

#include "support.h"

namespace {

namespace fs = std::filesystem;

struct Case {
  std::string kind, path, expect, what;
};
struct Result {
  std::string outcome, message;
  double seconds = 0;
  long peak_mib = 0;
};

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells;
  std::stringstream stream(line);
  for (std::string cell; std::getline(stream, cell, '\t');) cells.push_back(cell);
  return cells;
}

std::vector<Case> manifest(const fs::path& folder) {
  std::ifstream file(folder / "MANIFEST.tsv");
  std::vector<Case> cases;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    const auto cells = split(line);
    const std::string kind = cells.at(0).substr(0, cells.at(0).find('/'));
    if (kind != "safetensors")
      cases.push_back({kind, (folder / cells.at(0)).string(), cells.at(1), cells.at(2)});
  }
  return cases;
}

// Runs the probe over every second case; it prints one line a file.
std::map<std::string, Result> probed(const std::vector<Case>& cases, size_t first, const fs::path& scratch) {
  const fs::path list = scratch / ("list" + std::to_string(first));
  {
    std::ofstream out(list);
    for (size_t i = first; i < cases.size(); i += 2) out << cases[i].kind << '\t' << cases[i].path << '\n';
  }
  std::map<std::string, Result> results;
  std::FILE* pipe = ::popen(("'" PATINA_BAD_INPUT_PROBE "' < '" + list.string() + "'").c_str(), "r");
  if (!pipe) return results;
  std::string text;
  char buffer[4096];
  while (const size_t n = std::fread(buffer, 1, sizeof buffer, pipe)) text.append(buffer, n);
  ::pclose(pipe);
  std::stringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    auto cells = split(line);
    cells.resize(5);
    results[cells[0]] = {cells[1], cells[4], std::atof(cells[2].c_str()), std::atol(cells[3].c_str())};
  }
  return results;
}

bool is_plain_text(const std::string& text) {
  for (const unsigned char c : text)
    if (c < 0x20 || c == 0x7F || c == '~') return false;
  return true;
}

// Each case of a collection gets an answer or a clear refusal.
void expect_judged(const fs::path& folder, size_t min_cases) {
  const patina::test::TemporaryFolder scratch;
  const std::vector<Case> cases = manifest(folder);
  ASSERT_GE(cases.size(), min_cases);
  auto second_half = std::async(std::launch::async, [&] { return probed(cases, 1, scratch.path()); });
  std::map<std::string, Result> results = probed(cases, 0, scratch.path());
  results.merge(second_half.get());
  ASSERT_EQ(results.size(), cases.size());

  for (const Case& c : cases) {
    const Result& r = results.at(c.path);
    SCOPED_TRACE(c.path + " (" + c.what + ", " + c.expect + "): " + r.outcome + " " + r.message);
    EXPECT_TRUE(r.outcome == "ok" || r.outcome == "error");
    if (c.expect == "accept") {
      EXPECT_EQ(r.outcome, "ok");
    }
    // The collection is older than the rule that a missing picture costs its texture, not the asset.
    const bool lacks_a_picture = fs::path(c.path).filename() == "mtl_map_missing.obj" ||
                                 fs::path(c.path).filename() == "mtl_map_spaces.obj";
    if (c.expect == "reject") {
      EXPECT_EQ(r.outcome, lacks_a_picture ? "ok" : "error");
    }
    EXPECT_LT(r.peak_mib, 2048);
    if (r.outcome != "error") continue;
    EXPECT_NE(r.message.find(fs::path(c.path).filename().string().substr(0, 60)), std::string::npos)
        << "the message does not name the file";
    EXPECT_TRUE(is_plain_text(r.message)) << "the message holds control characters or several lines";
    EXPECT_GT(r.message.size(), c.path.size() + 10) << "the message does not name the fault";
  }
}

TEST(BadInputs, those_of_the_repository_get_an_answer_or_a_clear_refusal) {
  expect_judged(patina::test::data_dir() / "bad-inputs", 25);
}

TEST(BadInputs, those_of_the_shared_folder_get_an_answer_or_a_clear_refusal) {
  PATINA_REQUIRE_SHARED("bad-inputs/MANIFEST.tsv");
  expect_judged(patina::test::shared_dir() / "bad-inputs", 500);
}

}  // namespace
