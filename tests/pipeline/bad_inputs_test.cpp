// Every file of the collections of bad inputs as `patina info` takes it: refused with one clear message or
// accepted as the manifest says; no crash, no hang, no more memory than the file justifies. A few files go
// through the program itself, which turns the refusal into an exit code and a line.
#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "bad_inputs.h"
#include "in_process.h"
#include "patina/base/clock.h"
#include "patina/base/error.h"
#include "patina/base/memory.h"
#include "patina/pipeline/info.h"
#include "peak_memory.h"
#include "process.h"
#include "support.h"

namespace patina::test {
namespace {

constexpr double kMaxSeconds = 10;
constexpr double kMaxMemoryMb = 2048;

// While an object lives, a crash or a hang ends the test program with the name of the file that was read.
class NamesFile {
 public:
  NamesFile() {
    for (const int signal : kSignals) ::signal(signal, say_file);
  }
  ~NamesFile() {
    ::alarm(0);
    for (const int signal : kSignals) ::signal(signal, SIG_DFL);
  }
  void begin(const std::string& file) {
    std::strncpy(file_, file.c_str(), sizeof file_ - 1);
    ::alarm(6 * static_cast<unsigned>(kMaxSeconds));
  }

 private:
  static constexpr int kSignals[] = {SIGALRM, SIGSEGV, SIGBUS, SIGFPE, SIGABRT};
  static inline char file_[1024] = {};

  static void say_file(int signal) {
    const auto write = [](const char* text) { (void)!::write(STDERR_FILENO, text, std::strlen(text)); };
    write(signal == SIGALRM ? "hangs on " : "crashes on ");
    write(file_);
    write("\n");
    ::_exit(1);
  }
};

// What is wrong with a message about the file.
std::string faults_of(const std::string& message, const BadInput& c) {
  std::ostringstream faults;
  if (message.find(c.path.filename().string()) == std::string::npos) faults << " does not name the file";
  if (message.find("internal error") != std::string::npos) faults << " is about a fault of ours";
  if (message.size() > 4000) faults << " has " << message.size() << " bytes";
  return faults.str().empty() ? "" : " message" + faults.str() + ": " + message.substr(0, 300);
}

bool has_raw_control_character(const std::string& text, const std::string& allowed) {
  for (const char ch : text)
    if (((static_cast<unsigned char>(ch) < 0x20) || ch == 0x7F) && allowed.find(ch) == std::string::npos)
      return true;
  return false;
}

// Everything that is wrong with how the library took this file; empty: nothing.
std::string judge(const BadInput& c) {
  app::reset_peak_memory();
  const double memory_before_mb = static_cast<double>(resident_bytes()) / 1048576;
  const Clock::time_point start = Clock::now();
  std::ostringstream faults;
  try {
    const std::string text = pipeline::describe_file(c.path);
    if (c.expect == "reject") faults << " accepted: " << text.substr(0, 200);
    if (has_raw_control_character(text, "\n")) faults << " raw control character in its description";
  } catch (const Error& e) {
    if (c.expect == "accept") faults << " refused: " << e.what();
    faults << faults_of(e.what(), c);
    if (has_raw_control_character(e.what(), "")) faults << " message of several lines: " << e.what();
  } catch (const std::exception& e) {
    faults << " other exception: " << e.what();
  }
  const double memory_mb = static_cast<double>(peak_resident_bytes()) / 1048576 - memory_before_mb;
  if (seconds_since(start) > kMaxSeconds) faults << " took " << seconds_since(start) << " s";
  if (memory_mb > kMaxMemoryMb) faults << " took " << memory_mb << " MB";
  return faults.str();
}

void expect_judged_as_the_manifest_says(const std::filesystem::path& folder, size_t min_cases) {
  const std::vector<BadInput> cases = read_bad_inputs(folder);
  ASSERT_GE(cases.size(), min_cases);
  NamesFile names_file;
  for (const BadInput& c : cases) {
    names_file.begin(c.path.string());
    if (const std::string faults = judge(c); !faults.empty())
      ADD_FAILURE() << c.path << " (" << c.expect << ": " << c.what << "):" << faults;
  }
}

TEST(BadInputs, those_of_the_repository_are_judged_as_the_manifest_says) {
  expect_judged_as_the_manifest_says(data_dir() / "bad-inputs", 30);
}

TEST(BadInputs, those_of_the_shared_folder_are_judged_as_the_manifest_says) {
  PATINA_REQUIRE_SHARED("bad-inputs/MANIFEST.tsv");
  expect_judged_as_the_manifest_says(shared_dir() / "bad-inputs", 600);
}

TEST(BadInputs, the_program_refuses_in_one_line_with_exit_code_1) {
  std::set<std::string> kinds;
  for (const BadInput& c : read_bad_inputs(data_dir() / "bad-inputs")) {
    if (c.expect != "reject" || !kinds.insert(c.kind).second) continue;  // one of each kind
    SCOPED_TRACE(c.path);
    const ProcessResult result = patina({"info", c.path.string()});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(result.output, "");
    EXPECT_TRUE(result.error.starts_with("patina: ")) << result.error;
    EXPECT_EQ(result.error.find('\n'), result.error.size() - 1) << result.error;
    EXPECT_EQ(faults_of(result.error, c), "");
  }
  EXPECT_GE(kinds.size(), 7u);
}

TEST(BadInputs, the_program_describes_a_good_file_with_exit_code_0) {
  const ProcessResult result = run_process({built_program("patina").string(), "info",
                                            (data_dir() / "bad-inputs" / "glb" / "ok_base.glb").string()});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.error, "");
  EXPECT_NE(result.output.find("triangles"), std::string::npos) << result.output;
}

}  // namespace
}  // namespace patina::test
