// golden_check MODEL_DIR GOLDEN_DIR: compares a model folder in the diffusers layout with stored inputs and
// outputs of the reference implementation, file by file. Exit code 0: all are within their limits.
#include <cstdio>
#include <filesystem>

#include "console/program.h"
#include "dev/golden/golden.h"
#include "patina/base/error.h"

namespace {

void run(const std::filesystem::path& model, const std::filesystem::path& golden) {
  using namespace patina::diffusion;
  if (!std::filesystem::is_directory(model)) {
    throw patina::Error(patina::ErrorCode::kNotFound, model.string(),
                        "is no folder; expected a model in the diffusers layout");
  }
  const auto files = golden_files(golden);
  if (files.empty())
    throw patina::Error(patina::ErrorCode::kNotFound, golden.string(), "holds no golden files");

  GoldenChecker checker(model, golden);
  size_t num_failed = 0;
  std::printf("%-52s %12s %12s  %s\n", "case", "difference", "limit", "of the tensor nearest to its limit");
  for (const auto& file : files) {
    const GoldenResult result = checker.check(file);
    if (!result.ok()) ++num_failed;
    if (result.fault.empty()) {
      std::printf("%-52s %12.3g %12.3g  %-4s %s (%zu compared)\n", result.name.c_str(), result.difference,
                  result.limit, result.ok() ? "ok" : "FAIL", result.worst.c_str(), result.num_tensors);
    } else {
      std::printf("%-52s %12s %12s  FAIL %s\n", result.name.c_str(), "-", "-", result.fault.c_str());
    }
    std::fflush(stdout);
  }
  std::printf("%zu of %zu files within their limits\n", files.size() - num_failed, files.size());
  if (num_failed > 0)
    throw patina::Error(patina::ErrorCode::kFormat, golden.string(),
                        "holds results from which the networks of " + model.string() + " differ");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Compares a model's networks with stored results of the reference implementation.",
                   "golden_check");
  std::filesystem::path model, golden;
  program.add_option("MODEL_DIR", model, "Model folder in the diffusers layout")->required();
  program.add_option("GOLDEN_DIR", golden, "Stored inputs and outputs for that model")->required();
  return patina::tools::run_program(program, argc, argv, [&] { run(model, golden); });
}
