// golden_check MODEL_DIR GOLDEN_DIR: compares a model folder in the diffusers layout with stored inputs and
// outputs of the reference implementation, file by file. Exit code 0: all within their limits; 1: some are
// not; 2: could not run.
#include <cstdio>
#include <exception>
#include <filesystem>

#include "dev/golden/golden.h"
#include "patina/base/error.h"

namespace {

int run(const std::filesystem::path& model, const std::filesystem::path& golden) {
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
  return num_failed == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr,
                 "usage: golden_check MODEL_DIR GOLDEN_DIR\n"
                 "  MODEL_DIR   a model folder in the diffusers layout\n"
                 "  GOLDEN_DIR  stored inputs and outputs of the reference implementation for that model\n");
    return 2;
  }
  try {
    return run(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "golden_check: %s\n", error.what());
    return 2;
  }
}
