// Every file of the collection of bad inputs that is an asset, an image or an environment gets what its
// manifest says: an answer or a clear refusal, in bounded time and memory, without a crash.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <future>
#include <map>
#include <sstream>

#include <gtest/gtest.h>

#include "bad_inputs.h"
#include "support.h"

namespace {

namespace fs = std::filesystem;
using patina::test::BadInput;

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

// Those that are no models.
std::vector<BadInput> assets_and_images(const fs::path& folder) {
  std::vector<BadInput> cases = patina::test::read_bad_inputs(folder);
  std::erase_if(cases, [](const BadInput& input) { return input.kind == "safetensors"; });
  return cases;
}

// Runs the probe over every second case; it prints one line a file.
std::map<std::string, Result> probed(const std::vector<BadInput>& cases, size_t first,
                                     const fs::path& scratch) {
  const fs::path list = scratch / ("list" + std::to_string(first));
  {
    std::ofstream out(list);
    for (size_t i = first; i < cases.size(); i += 2)
      out << cases[i].kind << '\t' << cases[i].path.string() << '\n';
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
  const std::vector<BadInput> cases = assets_and_images(folder);
  ASSERT_GE(cases.size(), min_cases);
  auto second_half = std::async(std::launch::async, [&] { return probed(cases, 1, scratch.path()); });
  std::map<std::string, Result> results = probed(cases, 0, scratch.path());
  results.merge(second_half.get());
  ASSERT_EQ(results.size(), cases.size());

  for (const BadInput& c : cases) {
    const Result& r = results.at(c.path.string());
    SCOPED_TRACE(c.path.string() + " (" + c.what + ", " + c.expect + "): " + r.outcome + " " + r.message);
    EXPECT_TRUE(r.outcome == "ok" || r.outcome == "error");
    if (c.expect == "accept") {
      EXPECT_EQ(r.outcome, "ok");
    }
    if (c.expect == "reject") {
      EXPECT_EQ(r.outcome, "error");
    }
    EXPECT_LT(r.peak_mib, 2048);
    if (r.outcome != "error") continue;
    EXPECT_NE(r.message.find(c.path.filename().string().substr(0, 60)), std::string::npos)
        << "the message does not name the file";
    EXPECT_TRUE(is_plain_text(r.message)) << "the message holds control characters or several lines";
    EXPECT_GT(r.message.size(), c.path.string().size() + 10) << "the message does not name the fault";
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
