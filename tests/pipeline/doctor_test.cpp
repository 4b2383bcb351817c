// patina doctor: what it finds on a machine, and what it says when something is wrong.
#include <gtest/gtest.h>

#include "in_process.h"
#include "patina/attention/attention.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

void expect_problem(const std::vector<std::string>& options, const std::vector<std::string>& words) {
  std::vector<std::string> arguments{"doctor"};
  arguments.insert(arguments.end(), options.begin(), options.end());
  const ProcessResult result = patina(arguments);
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_EQ(result.output.find("All is well"), std::string::npos);
  const size_t problems = result.output.find("Problems:");
  ASSERT_NE(problems, std::string::npos) << result.output;
  for (const std::string& word : words)
    EXPECT_NE(result.output.find(word, problems), std::string::npos)
        << "'" << word << "' is not in: " << result.output;
  EXPECT_NE(result.error.find("doctor: there"), std::string::npos) << result.error;
}

TEST(Doctor, names_the_kernels_and_checks_models) {
  const ProcessResult result =
      patina({"doctor", "--model", (data_dir() / "tiny-sd").string(), "--model-dir", data_dir().string()});
  const std::vector<attention::CpuIsa> isas = attention::supported_isas(attention::Element::kBf16);
  for (const std::string& word : {std::string("processor  "), std::string("memory  "), std::string("GPU  "),
                                  std::string(attention::name_of(isas.back())) + " for bf16",
                                  std::string("tiny-sd: whole"), std::string("`patina models` lists them")})
    EXPECT_NE(result.output.find(word), std::string::npos) << "'" << word << "' is not in: " << result.output;
  EXPECT_EQ(result.exit_code == 0, result.output.find("All is well") != std::string::npos) << result.output;
}

TEST(Doctor, a_model_that_is_not_there_is_a_problem) {
  expect_problem({"--model", "/no/such/model"}, {"/no/such/model", "does not exist", "--model"});
  expect_problem({"--model-dir", "/no/such/models"}, {"/no/such/models", "--model-dir"});
}

TEST(Doctor, a_model_that_was_cut_short_is_a_problem) {
  const TemporaryFolder folder;
  const fs::path model = folder.path() / "cut";
  fs::copy(data_dir() / "tiny-sd", model, fs::copy_options::recursive);
  const fs::path weights = model / "unet" / "diffusion_pytorch_model.safetensors";
  fs::permissions(weights, fs::perms::owner_write, fs::perm_options::add);
  fs::resize_file(weights, fs::file_size(weights) / 2);
  expect_problem({"--model", model.string()}, {model.string(), "truncated", "unpack"});
}

}  // namespace
}  // namespace patina::test
