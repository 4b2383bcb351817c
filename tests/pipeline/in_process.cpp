#include "in_process.h"

#include <gtest/gtest.h>

#include "program.h"

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

}  // namespace patina::test
