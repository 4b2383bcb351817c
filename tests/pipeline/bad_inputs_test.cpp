// Every file of the collection of bad inputs through `patina info`: refused with one clear message or
// accepted as the manifest says; no crash, no hang, no more memory than the file justifies.
#include <algorithm>
#include <atomic>
#include <mutex>
#include <sstream>
#include <thread>

#include <gtest/gtest.h>

#include "bad_inputs.h"
#include "process.h"
#include "support.h"

namespace patina::test {
namespace {

constexpr double kMaxSeconds = 10;
constexpr double kMaxMemoryMb = 2048;

// Everything that is wrong with how patina took this file; empty: nothing.
std::string judge(const BadInput& c) {
  const ProcessResult result =
      run_process({built_program("patina").string(), "info", c.path.string()}, {.seconds = kMaxSeconds});
  std::ostringstream faults;
  if (result.signal)
    faults << " ended by signal " << result.signal;
  else if (result.exit_code != 0 && result.exit_code != 1)
    faults << " exit code " << result.exit_code;
  if (result.seconds > kMaxSeconds) faults << " took " << result.seconds << " s";
  if (result.peak_rss_mb > kMaxMemoryMb) faults << " took " << result.peak_rss_mb << " MB";
  if (c.expect == "reject" && result.exit_code == 0) faults << " accepted: " << result.output.substr(0, 200);
  if (c.expect == "accept" && result.exit_code == 1) faults << " refused: " << result.error.substr(0, 300);
  if (result.exit_code == 1) {
    const std::string name = c.path.filename().string();
    if (!result.error.starts_with("patina: ")) faults << " message: " << result.error.substr(0, 200);
    if (result.error.find(name) == std::string::npos)
      faults << " message does not name the file: " << result.error.substr(0, 200);
    if (result.error.find("internal error") != std::string::npos)
      faults << " " << result.error.substr(0, 200);
    if (result.error.size() > 4000) faults << " message of " << result.error.size() << " bytes";
    if (!result.output.empty()) faults << " printed a result and failed";
  }
  for (const std::string& text : {result.output, result.error})
    for (const char ch : text)
      if ((static_cast<unsigned char>(ch) < 0x20 && ch != '\n') || ch == 0x7F) {
        faults << " raw control character in its output";
        break;
      }
  return faults.str();
}

void expect_judged_as_the_manifest_says(const std::filesystem::path& folder, size_t min_cases) {
  const std::vector<BadInput> cases = read_bad_inputs(folder);
  ASSERT_GE(cases.size(), min_cases);
  std::atomic<size_t> next{0};
  std::mutex mutex;
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < std::max(2u, std::thread::hardware_concurrency()); ++t)
    threads.emplace_back([&] {
      for (size_t i; (i = next.fetch_add(1)) < cases.size();)
        if (const std::string faults = judge(cases[i]); !faults.empty()) {
          const std::lock_guard lock(mutex);
          ADD_FAILURE() << cases[i].path << " (" << cases[i].expect << ": " << cases[i].what
                        << "):" << faults;
        }
    });
  for (std::thread& thread : threads) thread.join();
}

TEST(BadInputs, info_judges_those_of_the_repository_as_the_manifest_says) {
  expect_judged_as_the_manifest_says(data_dir() / "bad-inputs", 30);
}

TEST(BadInputs, info_judges_those_of_the_shared_folder_as_the_manifest_says) {
  PATINA_REQUIRE_SHARED("bad-inputs/MANIFEST.tsv");
  expect_judged_as_the_manifest_says(shared_dir() / "bad-inputs", 600);
}

}  // namespace
}  // namespace patina::test
