// The networks against stored inputs and outputs of the reference implementation: the small cases of
// tests/data always, all of the shared folder where it is.
#include "dev/golden/golden.h"

#include <set>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "support.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

fs::path tiny_model() {
  return test::data_dir() / "tiny-sd";
}
fs::path local_golden() {
  return test::data_dir() / "golden";
}

class Golden : public testing::TestWithParam<fs::path> {
 protected:
  static void SetUpTestSuite() { checker_ = std::make_unique<GoldenChecker>(tiny_model(), local_golden()); }
  static void TearDownTestSuite() { checker_.reset(); }
  static std::unique_ptr<GoldenChecker> checker_;
};
std::unique_ptr<GoldenChecker> Golden::checker_;

TEST_P(Golden, stays_within_its_limit) {
  const GoldenResult result = checker_->check(GetParam());
  EXPECT_EQ(result.fault, "");
  EXPECT_LE(result.difference, result.limit) << result.worst;
  EXPECT_GT(result.num_tensors, 0u);
}

INSTANTIATE_TEST_SUITE_P(All, Golden, testing::ValuesIn(golden_files(local_golden())),
                         [](const auto& test_info) {
                           std::string name = test_info.param.stem().string();
                           for (char& c : name) {
                             if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                           }
                           return name;
                         });

TEST(GoldenShared, all_cases_stay_within_their_limits) {
  PATINA_REQUIRE_SHARED("golden/golden");
  const fs::path golden = test::shared_dir() / "golden" / "golden";
  GoldenChecker checker(tiny_model(), golden);
  std::set<std::string> local;
  for (const fs::path& file : golden_files(local_golden())) local.insert(file.filename().string());
  for (const fs::path& file : golden_files(golden)) {
    if (local.contains(file.filename().string())) continue;  // ran above
    const GoldenResult result = checker.check(file);
    EXPECT_TRUE(result.ok()) << result.name << ": " << result.worst << " differs by " << result.difference
                             << ", limit " << result.limit << " " << result.fault;
  }
}

TEST(GoldenFaults, unknown_and_broken_files_are_faults_of_the_file) {
  test::TemporaryFolder folder;
  const auto fault = [&](const std::string& name) {
    return GoldenChecker(tiny_model(), folder.path()).check(folder.path() / name).fault;
  };
  fs::copy_file(local_golden() / "timestep_embedding_320.safetensors", folder.path() / "mystery.safetensors");
  EXPECT_EQ(fault("mystery.safetensors"), "is of no known kind");
  fs::copy_file(local_golden() / "timestep_embedding_320.safetensors", folder.path() / "unet_x.safetensors");
  EXPECT_NE(fault("unet_x.safetensors").find("lacks the tensor"), std::string::npos);
  write_file(folder.path() / "tokenizer_cases.json", "{}");
  EXPECT_NE(fault("tokenizer_cases.json"), "");
}

TEST(GoldenFaults, a_wrong_model_is_past_the_limit) {
  // The ControlNet for normals in the place of that for tiles.
  test::TemporaryFolder folder;
  fs::copy(tiny_model() / "controlnet_normal", folder.path() / "controlnet_tile");
  const fs::path file = local_golden() / "controlnet_tile_8x8_b1_t500_scale1.0.safetensors";
  const GoldenResult result = GoldenChecker(folder.path(), local_golden()).check(file);
  EXPECT_EQ(result.fault, "");
  EXPECT_FALSE(result.ok());
}

}  // namespace
}  // namespace patina::diffusion
