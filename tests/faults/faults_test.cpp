// A disk that is full or fails, at every place where a run writes: the message names the file, the output is
// the old one or the whole new one, and the next run of the same command ends with the bytes of an
// undisturbed one. By default some of the calls fail, each in a run of its own; with PATINA_FAULTS=all every
// one (docs/reliability.md).
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "failing_calls.h"
#include "in_process.h"
#include "patina/base/files.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

// Every stage, as little of it as can be.
std::vector<std::string> enhance_command(const fs::path& folder) {
  return {"enhance",
          (data_dir() / "cases/obj/plain/box.obj").string(),
          "-p",
          "rust",
          "-m",
          (data_dir() / "tiny-sd").string(),
          "--views",
          "1",
          "--resolution",
          "64",
          "--bias",
          "0",
          "--samples",
          "1",
          "-s",
          "1",
          "--fit",
          "base_color",
          "--fit-iterations",
          "2",
          "--texture-size",
          "32",
          "--turntable",
          "1",
          "--quiet",
          "-o",
          (folder / "out.glb").string()};
}

// "…/.out.1234.glb" is the name beside it under which out.glb is written.
fs::path final_name(const fs::path& path) {
  const std::string name = path.filename().string(), pid = "." + std::to_string(::getpid());
  const size_t at = name.find(pid);
  if (name[0] != '.' || at == std::string::npos) return path;
  return path.parent_path() / (name.substr(1, at - 1) + name.substr(at + pid.size()));
}

// Everything that a run leaves but what tells times.
std::map<std::string, std::string> hashes_of(const fs::path& folder) {
  std::map<std::string, std::string> hashes;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::set<std::string> kinds{".png", ".exr", ".webp", ".glb"};
    if (entry.is_regular_file() && kinds.count(entry.path().extension().string()))
      hashes[fs::relative(entry.path(), folder).string()] = hash_file(entry.path());
  }
  return hashes;
}

// One run in which the call of that number fails (negative: none); what was called, in order.
struct DisturbedRun {
  ProcessResult result;
  std::vector<FileCall> calls;
};
DisturbedRun run_with_failure(const fs::path& folder, int number, int error) {
  DisturbedRun run;
  const FailingCalls failing(folder, [&](const FileCall& call) {
    const fs::path file = final_name(call.path);
    if (file.filename() == ".lock") return 0;
    run.calls.push_back({call.kind, file.string()});
    return static_cast<int>(run.calls.size()) - 1 == number ? error : 0;
  });
  run.result = patina(enhance_command(folder));
  return run;
}

// A checkpoint and the preview of a fit are a help, no result: a run goes on without.
bool may_go_on_without(const std::string& path) {
  return path.find("checkpoint") != std::string::npos || path.find("/preview") != std::string::npos;
}

// What is wrong with how a run ended whose call failed.
void expect_refused(const FileCall& failed, const ProcessResult& result) {
  EXPECT_EQ(result.exit_code, 1) << result.error;
  EXPECT_TRUE(result.error.starts_with("patina: ")) << result.error;
  EXPECT_NE(result.error.find(fs::path(failed.path).filename().string()), std::string::npos) << result.error;
  EXPECT_EQ(result.error.find("fault of patina"), std::string::npos) << result.error;
  const bool is_full = result.error.find("No space left") != std::string::npos;
  EXPECT_TRUE(is_full || result.error.find("Input/output error") != std::string::npos) << result.error;
  if (is_full && failed.kind == "write") {
    EXPECT_NE(result.error.find(" bytes"), std::string::npos) << result.error;
  }
}

// Which calls fail: all of them, or one of each kind, early in the run for the first and late for the last.
std::vector<int> chosen_calls(const std::vector<FileCall>& calls, bool all) {
  static constexpr const char* kKinds[] = {"mkdir", "rename", "write", "open", "fsync"};
  std::vector<int> chosen;
  for (size_t i = 0; i < calls.size() && all; ++i) chosen.push_back(static_cast<int>(i));
  for (size_t k = 0; k < std::size(kKinds) && !all; ++k) {
    std::vector<int> of_kind;
    for (size_t i = 0; i < calls.size(); ++i)
      if (calls[i].kind == kKinds[k]) of_kind.push_back(static_cast<int>(i));
    if (!of_kind.empty()) chosen.push_back(of_kind[of_kind.size() * k / std::size(kKinds)]);
  }
  return chosen;
}

TEST(Faults, a_full_or_failing_disk_is_named_and_the_next_run_goes_on_to_the_same_bytes) {
  const TemporaryFolder whole, broken;
  const DisturbedRun undisturbed = run_with_failure(whole.path(), -1, 0);
  ASSERT_EQ(undisturbed.result.exit_code, 0) << undisturbed.result.error;
  const auto expected = hashes_of(whole.path());
  const fs::path output = broken.path() / "out.glb";
  const std::string old = "the output of another day";

  const char* all = std::getenv("PATINA_FAULTS");
  std::map<std::string, int> num_failed;
  for (const int number : chosen_calls(undisturbed.calls, all && std::string(all) == "all")) {
    fs::remove_all(broken.path() / "out.patina-run");
    write_file(output, old);
    const DisturbedRun run = run_with_failure(broken.path(), number, number % 8 < 4 ? ENOSPC : EIO);
    ASSERT_GT(run.calls.size(), static_cast<size_t>(number));
    const FileCall& failed = run.calls[static_cast<size_t>(number)];
    SCOPED_TRACE(failed.kind + " of " + failed.path);
    ++num_failed[failed.kind];
    if (!may_go_on_without(failed.path) || run.result.exit_code != 0) expect_refused(failed, run.result);
    if (const std::string hash = hash_file(output); hash != hash_text(old)) {
      EXPECT_EQ(hash, expected.at("out.glb"));
    }
    for (const auto& entry : fs::recursive_directory_iterator(broken.path()))
      EXPECT_EQ(final_name(entry.path()), entry.path()) << "is left behind";
    const ProcessResult next = patina(enhance_command(broken.path()));
    EXPECT_EQ(next.exit_code, 0) << next.error;
    EXPECT_EQ(hashes_of(broken.path()), expected);
  }
  for (const auto& [kind, count] : num_failed) std::printf("%3d of %s failed\n", count, kind.c_str());
  for (const char* kind : {"mkdir", "rename", "write", "open", "fsync"})
    EXPECT_GT(num_failed[kind], 0) << kind;
}

}  // namespace
}  // namespace patina::test
