// The run folder: stages are skipped exactly when nothing changed, checkpoints belong to their inputs, one
// process owns it.
#include "patina/pipeline/run_folder.h"

#include <gtest/gtest.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "support.h"

namespace patina::pipeline {
namespace {

// Counts how often a stage really ran.
struct CountingStage {
  RunFolder& run;
  int runs = 0;

  void operator()(const std::string& key, const std::string& output = "a.txt") {
    run.run_stage("work", key, {}, [&] {
      ++runs;
      write_file(run.file(output), key);
      return RunFolder::StageResult{.outputs = {output}, .metrics = {{"value", runs}}, .warnings = {}};
    });
  }
};

TEST(RunFolder, runs_a_stage_once_for_one_key) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  CountingStage stage{run};
  stage("key 1");
  stage("key 1");
  EXPECT_EQ(stage.runs, 1);
  stage("key 2");
  EXPECT_EQ(stage.runs, 2);
  EXPECT_EQ(run.stages().size(), 1u);
}

TEST(RunFolder, runs_again_when_an_output_is_missing) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  CountingStage stage{run};
  stage("key");
  std::filesystem::remove(run.file("a.txt"));
  stage("key");
  EXPECT_EQ(stage.runs, 2);
}

TEST(RunFolder, keeps_an_output_that_was_edited_by_hand) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  CountingStage stage{run};
  stage("key");
  write_file(run.file("a.txt"), "painted over");
  stage("key");
  EXPECT_EQ(stage.runs, 1);
  EXPECT_EQ(read_text_file(run.file("a.txt")), "painted over");
}

TEST(RunFolder, remembers_stages_and_metrics_from_process_to_process) {
  const test::TemporaryFolder folder;
  {
    RunFolder run(folder.path() / "run");
    CountingStage{run}("key");
  }
  RunFolder run(folder.path() / "run");
  CountingStage stage{run};
  stage("key");
  EXPECT_EQ(stage.runs, 0);
  EXPECT_EQ(run.stage("work")->metrics.at("value"), 1);
  EXPECT_GT(run.stage("work")->peak_rss_mb, 1.0);
}

TEST(RunFolder, a_failed_stage_leaves_no_record) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  EXPECT_THROW(run.run_stage("work", "key", {},
                             []() -> RunFolder::StageResult { throw Error(ErrorCode::kIo, "", "failed"); }),
               Error);
  EXPECT_EQ(run.stage("work"), nullptr);
}

TEST(RunFolder, a_checkpoint_belongs_to_its_key_and_is_whole_or_not_there) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  EXPECT_FALSE(run.load_checkpoint("work", "key"));
  const std::vector<uint8_t> bytes = {1, 2, '\n', 4};
  run.save_checkpoint("work", "key", 7, bytes);
  const auto saved = run.load_checkpoint("work", "key");
  ASSERT_TRUE(saved);
  EXPECT_EQ(saved->step, 7);
  EXPECT_EQ(saved->bytes, bytes);
  EXPECT_FALSE(run.load_checkpoint("work", "other key"));

  auto file = read_file(run.file(".work.checkpoint"));
  file.back() ^= 1;
  write_file(run.file(".work.checkpoint"), file);
  EXPECT_FALSE(run.load_checkpoint("work", "key"));
}

TEST(RunFolder, a_finished_stage_removes_its_checkpoint) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  run.save_checkpoint("work", "key", 1, {1});
  CountingStage{run}("key");
  EXPECT_FALSE(std::filesystem::exists(run.file(".work.checkpoint")));
}

TEST(RunFolder, refuses_a_second_owner) {
  const test::TemporaryFolder folder;
  const RunFolder run(folder.path() / "run");
  EXPECT_THROW(RunFolder(folder.path() / "run"), Error);
}

TEST(RunFolder, refuses_a_record_that_is_not_one) {
  const test::TemporaryFolder folder;
  write_file(folder.path() / "run" / "stages.json", std::string_view("[{\"name\": 3}]"));
  EXPECT_THROW(RunFolder(folder.path() / "run"), Error);
  write_file(folder.path() / "run" / "stages.json", std::string_view("{"));
  EXPECT_THROW(RunFolder(folder.path() / "run"), Error);
}

}  // namespace
}  // namespace patina::pipeline
