// Several seeds from one rendering, and going on with the one that was chosen.
#include "patina/pipeline/variants.h"

#include <gtest/gtest.h>

#include "in_process.h"
#include "patina/base/files.h"
#include "process.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;

ProcessResult enhanced(const fs::path& output, const std::vector<std::string>& more) {
  std::vector<std::string> options{"--resolution", "64", "--samples",        "1",
                                   "-s",           "2",  "--fit-iterations", "1"};
  options.insert(options.end(), more.begin(), more.end());
  return enhance_small_kettle(output, options);
}

TEST(Variants, seeds_share_their_renders_and_the_chosen_edit_is_not_made_again) {
  const TemporaryFolder folder;
  const fs::path output = folder.path() / "out.glb", run = folder.path() / "out.patina-run";
  const auto edited = [&](const fs::path& in) { return read_file(in / "detail" / "edited_02.png"); };

  ProcessResult result = enhanced(output, {"--seeds", "3", "--edit-seed", "5"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_NE(result.error.find("variants.html"), std::string::npos) << result.error;
  EXPECT_FALSE(fs::exists(output));
  EXPECT_FALSE(fs::exists(run / "textures"));
  const fs::path variants = run / "variants";
  EXPECT_NE(edited(variants / "seed_5"), edited(variants / "seed_6"));
  EXPECT_EQ(edited(run), edited(variants / "seed_5"));
  const std::string page = read_text_file(variants / "variants.html");
  for (const char* text : {"a rusty old kettle", "seed 5", "seed 6", "seed 7", "Before"})
    EXPECT_NE(page.find(text), std::string::npos) << text;
  const auto rendered = fs::last_write_time(run / "views" / "tile_00.png"),
             made = fs::last_write_time(variants / "seed_6" / "detail" / "edited_02.png");

  result = enhanced(output, {"--edit-seed", "7"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(edited(run), edited(variants / "seed_7"));
  EXPECT_TRUE(fs::exists(output));
  EXPECT_EQ(fs::last_write_time(run / "views" / "tile_00.png"), rendered);
  EXPECT_EQ(fs::last_write_time(variants / "seed_6" / "detail" / "edited_02.png"), made);
}

TEST(Variants, a_draft_ends_with_edited_views) {
  const TemporaryFolder folder;
  const fs::path output = folder.path() / "out.glb", run = folder.path() / "out.patina-run";
  const ProcessResult result = enhanced(output, {"--preset", "draft"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_TRUE(fs::exists(run / "variants" / "variants.html"));
  EXPECT_TRUE(fs::exists(run / "detail" / "edited_03.png"));
  EXPECT_FALSE(fs::exists(run / "textures"));
  EXPECT_FALSE(fs::exists(output));
}

}  // namespace
}  // namespace patina::test
