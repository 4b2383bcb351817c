#include "in_process.h"

#include <gtest/gtest.h>

#include "program.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::test {

ProcessResult patina(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "patina");
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  ProcessResult result;
  result.exit_code = app::run_program(static_cast<int>(arguments.size()), argv.data());
  result.output = testing::internal::GetCapturedStdout();
  result.error = testing::internal::GetCapturedStderr();
  return result;
}

ProcessResult enhance_small_kettle(const std::filesystem::path& output,
                                   const std::vector<std::string>& options) {
  std::vector<std::string> arguments{
      "enhance", small_kettle().string(), "-p", "a rusty old kettle", "--views", "4", "--turntable", "0",
      "-o",      output.string()};
  arguments.insert(arguments.end(), options.begin(), options.end());
  return patina(arguments);
}

void expect_refused_before_rendering(const std::vector<Refusal>& refusals) {
  for (const Refusal& refusal : refusals) {
    SCOPED_TRACE(refusal.options.back());
    const TemporaryFolder folder;
    const ProcessResult result = enhance_small_kettle(folder.path() / "out.glb", refusal.options);
    EXPECT_EQ(result.exit_code, refusal.exit_code) << result.error;
    for (const std::string& text : refusal.says)
      EXPECT_NE(result.error.find(text), std::string::npos) << text << " in " << result.error;
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "out.patina-run" / "views"));
  }
}

}  // namespace patina::test
