// The run folder: stages are skipped exactly when nothing changed, checkpoints belong to their inputs, one
// process owns it.
#include "patina/pipeline/run_folder.h"

#include <malloc.h>

#include <chrono>
#include <fstream>
#include <thread>

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

TEST(RunFolder, goes_again_if_it_made_its_folder_and_nothing_ran_in_it) {
  const test::TemporaryFolder folder;
  const auto make = [&](const std::filesystem::path& path, const char* file) {
    RunFolder run(path);
    write_json(run.file(file), {});
  };
  make(folder.path() / "new" / "run", "config.json");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "new"));
  make(folder.path() / "used" / "run", ".detail.checkpoint");
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "used" / "run" / ".detail.checkpoint"));
  std::filesystem::create_directory(folder.path() / "given");
  make(folder.path() / "given", "config.json");
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "given" / "config.json"));
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

TEST(RunFolder, is_free_again_after_its_record_was_refused) {
  const test::TemporaryFolder folder;
  const std::filesystem::path record = folder.path() / "run" / "stages.json";
  for (const std::string_view malformed : {"[{\"name\": 3}]", "not JSON"}) {
    write_file(record, malformed);
    EXPECT_THROW(RunFolder(folder.path() / "run"), Error);
    write_file(record, std::string_view("[]"));
    EXPECT_NO_THROW(RunFolder(folder.path() / "run"));
  }
}

TEST(RunFolder, refuses_a_record_that_is_not_one) {
  const test::TemporaryFolder folder;
  write_file(folder.path() / "run" / "stages.json", std::string_view("[{\"name\": 3}]"));
  EXPECT_THROW(RunFolder(folder.path() / "run"), Error);
  write_file(folder.path() / "run" / "stages.json", std::string_view("{"));
  EXPECT_THROW(RunFolder(folder.path() / "run"), Error);
}

TEST(RunFolder, takes_over_a_stage_with_outputs_and_record) {
  const test::TemporaryFolder folder;
  RunFolder first(folder.path() / "first"), second(folder.path() / "second");
  second.adopt_stage(first, "work");
  EXPECT_EQ(second.stage("work"), nullptr);
  CountingStage{first}("key", "views/a.txt");
  second.adopt_stage(first, "work");
  CountingStage stage{second};
  stage("key", "views/a.txt");
  EXPECT_EQ(stage.runs, 0);
  EXPECT_EQ(read_text_file(second.file("views/a.txt")), "key");
  EXPECT_EQ(second.stage("work")->seconds, first.stage("work")->seconds);

  // What is here stays as it is, also where it was changed by hand.
  write_file(second.file("views/a.txt"), "painted over");
  second.adopt_stage(first, "work");
  EXPECT_EQ(read_text_file(second.file("views/a.txt")), "painted over");
  CountingStage{first}("another key", "views/a.txt");
  second.adopt_stage(first, "work");
  EXPECT_EQ(read_text_file(second.file("views/a.txt")), "another key");
}

TEST(RunFolder, time_spent_before_a_kill_counts) {
  const test::TemporaryFolder folder;
  const auto wait = [] { std::this_thread::sleep_for(std::chrono::milliseconds(60)); };
  {
    RunFolder run(folder.path() / "run");
    EXPECT_THROW(run.run_stage("work", "key", {},
                               [&]() -> RunFolder::StageResult {
                                 wait();
                                 run.save_checkpoint("work", "key", 1, {1});
                                 throw Error(ErrorCode::kInterrupted, "", "killed");
                               }),
                 Error);
  }
  RunFolder run(folder.path() / "run");
  const StageRecord& record = run.run_stage("work", "key", {}, [&] {
    EXPECT_TRUE(run.load_checkpoint("work", "key").has_value());
    wait();
    return RunFolder::StageResult{};
  });
  EXPECT_GE(record.seconds, 0.12);
  EXPECT_LT(record.seconds, 60);
  EXPECT_LT(run.run_stage("next", "key", {}, [] { return RunFolder::StageResult{}; }).seconds, 0.06);
}

TEST(RunFolder, refuses_a_folder_that_holds_other_files) {
  const test::TemporaryFolder folder;
  write_file(folder.path() / "thesis.txt", std::string_view("years of work"));
  EXPECT_THROW(RunFolder(folder.path()), Error);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / ".lock"));
  std::filesystem::remove(folder.path() / "thesis.txt");
  EXPECT_NO_THROW(RunFolder(folder.path()));  // empty
  EXPECT_NO_THROW(RunFolder(folder.path()));  // a run folder by now
}

TEST(RunFolder, a_picture_that_was_changed_by_hand_is_copied_before_its_stage_runs_again) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  CountingStage stage{run};
  stage("key 1", "detail/edited_01.png");
  write_file(run.file("detail/edited_01.png"), "painted");
  stage("key 2", "detail/edited_01.png");
  EXPECT_EQ(read_text_file(run.file("detail/edited_01.png")), "key 2");
  EXPECT_EQ(read_text_file(run.file("detail/edited_01.by-hand.png")), "painted");

  write_file(run.file("detail/edited_01.png"), "painted again");
  run.keep_what_was_changed_by_hand(true);
  stage("key 3", "detail/edited_01.png");
  EXPECT_EQ(read_text_file(run.file("detail/edited_01.png")), "painted again");
  EXPECT_EQ(read_text_file(run.file("detail/edited_01.by-hand-2.png")), "painted again");
  stage("key 4", "detail/edited_01.png");  // it still counts as changed
  EXPECT_EQ(read_text_file(run.file("detail/edited_01.png")), "painted again");
}

// A run with other options that is killed while it writes leaves files of both: who comes back to the old
// options must not get them.
TEST(RunFolder, a_stage_that_was_killed_while_it_wrote_is_not_taken_for_the_one_before_it) {
  const test::TemporaryFolder folder;
  {
    RunFolder run(folder.path() / "run");
    CountingStage stage{run};
    stage("key 1");
    EXPECT_THROW(run.run_stage("work", "key 2", {},
                               [&]() -> RunFolder::StageResult {
                                 write_file(run.output("a.txt"), std::string_view("of key 2"));
                                 throw Error(ErrorCode::kInterrupted, "", "killed");
                               }),
                 Error);
  }
  RunFolder run(folder.path() / "run");
  EXPECT_EQ(run.stage("work"), nullptr);
  CountingStage stage{run};
  stage("key 1", "b.txt");
  EXPECT_EQ(stage.runs, 1);
  EXPECT_FALSE(std::filesystem::exists(run.file("a.txt")));  // no longer made
  EXPECT_FALSE(std::filesystem::exists(run.file("a.by-hand.txt")));
}

TEST(RunFolder, what_a_killed_process_wrote_half_is_removed) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "run";
  {
    RunFolder made(path);
    CountingStage stage{made};
    stage("key");
  }
  for (const char* name :
       {".config.42.json", "views/.tile_00.4711.png", "views/.hidden.png", "views/a.1.png"})
    write_file(path / name, std::string_view("half"));
  const RunFolder run(path);
  EXPECT_FALSE(std::filesystem::exists(run.file(".config.42.json")));
  EXPECT_FALSE(std::filesystem::exists(run.file("views/.tile_00.4711.png")));
  EXPECT_TRUE(std::filesystem::exists(run.file("views/.hidden.png")));
  EXPECT_TRUE(std::filesystem::exists(run.file("views/a.1.png")));
}

TEST(RunFolder, a_stage_that_was_killed_before_it_wrote_leaves_the_one_before_it) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  CountingStage stage{run};
  stage("key 1");
  EXPECT_THROW(
      run.run_stage("work", "key 2", {},
                    []() -> RunFolder::StageResult { throw Error(ErrorCode::kInterrupted, "", "killed"); }),
      Error);
  stage("key 1");
  EXPECT_EQ(stage.runs, 1);
}

TEST(RunFolder, a_damaged_record_is_refused_with_what_to_do) {
  const test::TemporaryFolder folder;
  const auto refusal = [&](std::string_view text) -> std::string {
    write_file(folder.path() / "stages.json", text);
    try {
      RunFolder run(folder.path());
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  for (const char* text : {"", "garbage", "{\"a\": 1}", "[1]", "[{\"name\": 3}]"}) {
    SCOPED_TRACE(text);
    const std::string message = refusal(text);
    EXPECT_NE(message.find("stages.json"), std::string::npos) << message;
    EXPECT_NE(message.find("remove it"), std::string::npos) << message;
    EXPECT_EQ(message.find("json.exception"), std::string::npos) << message;
  }
}

TEST(RunFolder, a_record_that_names_files_elsewhere_is_refused_and_they_stay) {
  const test::TemporaryFolder folder;
  const auto outside = folder.path() / "thesis.txt";
  write_file(outside, std::string_view("years of work"));
  for (const std::string& output : {std::string("../thesis.txt"), std::string("a/../../thesis.txt"),
                                    outside.string(), std::string("..")}) {
    const nlohmann::json record = {{{"name", "work"},
                                    {"key", "k"},
                                    {"outputs", {output}},
                                    {"seconds", 1},
                                    {"peak_rss_mb", 1},
                                    {"metrics", nlohmann::json::object()},
                                    {"warnings", nlohmann::json::array()}}};
    write_json(folder.path() / "run" / "stages.json", record);
    EXPECT_THROW(RunFolder(folder.path() / "run").clear(), Error) << output;
    EXPECT_TRUE(std::filesystem::exists(outside));
  }
}

TEST(RunFolder, a_damaged_checkpoint_is_none) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  for (const char* text : {"", "{}", "{}\n", "[]\n", "{\"key\": 1}\n",
                           "{\"key\": \"key\", \"step\": \"x\", \"hash\": \"\"}\n"}) {
    write_file(run.file(".work.checkpoint"), std::string_view(text));
    EXPECT_FALSE(run.load_checkpoint("work", "key")) << text;
  }
}

TEST(RunFolder, a_checkpoint_that_cannot_be_written_is_a_warning) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  std::filesystem::create_directories(run.file(".work.checkpoint") / "in the way");
  std::vector<std::string> warnings;
  RunProgress progress;
  progress.on_warning = [&](std::string_view text) { warnings.emplace_back(text); };
  EXPECT_NO_THROW(run.run_stage("work", "key", progress, [&] {
    run.save_checkpoint("work", "key", 1, {1, 2, 3});
    return RunFolder::StageResult{};
  }));
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find(".work.checkpoint"), std::string::npos) << warnings[0];
}

TEST(RunFolder, outputs_that_a_stage_no_longer_makes_are_removed) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  CountingStage stage{run};
  stage("key 1", "textures/lid.png");
  stage("key 2", "textures/body.png");
  EXPECT_FALSE(std::filesystem::exists(run.file("textures/lid.png")));
  run.clear();
  EXPECT_FALSE(std::filesystem::exists(run.file("textures/body.png")));
  EXPECT_EQ(run.stage("work"), nullptr);
}

TEST(RunFolder, tells_which_stages_run_and_which_are_reused) {
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  std::vector<StageEvent> events;
  RunProgress progress;
  progress.on_stage = [&](std::string_view stage, StageEvent event) {
    EXPECT_EQ(stage, "work");
    events.push_back(event);
  };
  for (int i = 0; i < 2; ++i) run.run_stage("work", "key", progress, [] { return RunFolder::StageResult{}; });
  EXPECT_EQ(events, (std::vector{StageEvent::kStarted, StageEvent::kFinished, StageEvent::kReused}));
}

TEST(RunFolder, memory_that_was_freed_before_a_stage_is_not_counted_as_its_own) {
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "the address sanitiser keeps freed memory";
#endif
  const test::TemporaryFolder folder;
  RunFolder run(folder.path() / "run");
  // A program may reset the kernel's mark when a stage starts; the library leaves the process alone.
  RunProgress progress;
  progress.on_stage = [](std::string_view, StageEvent event) {
    if (event != StageEvent::kStarted) return;
    ::malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << "5";
  };
  const auto peak_of = [&](const char* name, size_t blocks) {
    return run
        .run_stage(name, "key", progress,
                   [&] {
                     // Blocks below malloc's threshold for mappings of their own stay in its arena when
                     // freed.
                     std::vector<std::vector<char>> memory;
                     for (size_t i = 0; i < blocks; ++i) memory.emplace_back(size_t{64} << 10, '1');
                     return RunFolder::StageResult{};
                   })
        .peak_rss_mb;
  };
  const double before = peak_of("before", 0);
  EXPECT_GT(peak_of("large", 2000), before + 100);
  EXPECT_LT(peak_of("after", 0), before + 40);
}

}  // namespace
}  // namespace patina::pipeline
