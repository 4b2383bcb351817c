// Many runs as one: what a job file means, that results are those of separate runs, and that nothing that
// fails stops the rest.
#include "patina/pipeline/batch.h"

#include <cstdlib>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "in_process.h"
#include "jobs_file.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/pipeline/enhance.h"
#include "process.h"
#include "slurm.h"
#include "small_kettle.h"
#include "support.h"

namespace patina::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using pipeline::Batch;

// Options with which a job takes a second.
const std::string kSmall =
    "[options]\nviews = 4\nresolution = 64\nsamples = 1\nsteps = 2\nfit-iterations = 1\nturntable = 0\n";

class BatchFolder {
 public:
  fs::path path() const { return folder_.path(); }
  fs::path results() const { return path() / "results"; }
  fs::path jobs() const { return path() / "jobs.toml"; }

  // The asset under a name of its own.
  fs::path add_asset(const std::string& name) const {
    fs::copy_file(small_kettle(), path() / name);
    return path() / name;
  }
  // `toml` with the folder of the results before it; "DIR" stands for this folder.
  app::JobsFile read_all(const std::string& toml) const {
    std::string text = "output = \"DIR/results\"\n" + toml;
    for (size_t at; (at = text.find("DIR")) != std::string::npos;) text.replace(at, 3, path().string());
    write_file(jobs(), text);
    return app::read_jobs(jobs());
  }
  Batch read(const std::string& toml) const { return read_all(toml).batch; }
  ProcessResult run(const std::vector<std::string>& options = {}) const {
    std::vector<std::string> arguments{"batch", jobs().string()};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return patina(arguments);
  }
  // What reading says of a file that it refuses.
  std::string refusal(const std::string& toml) const {
    try {
      read(toml);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kUsage);
      return e.what();
    }
    ADD_FAILURE() << "taken: " << toml;
    return "";
  }

 private:
  TemporaryFolder folder_;
};

std::vector<std::string> names_of(const Batch& batch) {
  std::vector<std::string> names;
  for (const pipeline::BatchJob& job : batch.jobs) names.push_back(job.name);
  return names;
}

TEST(JobsFile, is_every_asset_with_every_prompt_and_seed) {
  const BatchFolder folder;
  for (const char* name : {"b.glb", "a.glb", "notes.txt"})
    write_file(folder.path() / name, std::string_view());
  const Batch batch = folder.read(
      "assets = [\"DIR/*.glb\", \"DIR/missing.obj\"]\nprompts = [\"moss\", \"(rust:1.2), old\"]\n"
      "seeds = [1, 2]\n[options]\nsteps = 7\nprompt-for = [\"wood=grey wood\"]\n");
  const std::vector<std::string> names = names_of(batch);
  ASSERT_EQ(names.size(), 12u);
  EXPECT_EQ(names[0], "a_moss_1");
  EXPECT_EQ(names[1], "a_moss_2");
  EXPECT_TRUE(names[2].starts_with("a_rust-1-2-old-")) << names[2];
  EXPECT_EQ(names[4], "b_moss_1");
  EXPECT_EQ(names[8], "missing_moss_1");
  EXPECT_EQ(batch.jobs[3].config.edit.options.prompt, "(rust:1.2), old");
  EXPECT_EQ(batch.jobs[3].config.edit.options.seed, 2u);
  EXPECT_EQ(batch.jobs[3].config.fit.options.seed, 2u);
  EXPECT_EQ(batch.jobs[3].config.edit.options.num_steps, 7);
  EXPECT_EQ(batch.jobs[8].config.output, folder.results() / "missing_moss_1" / "missing.obj");
}

TEST(JobsFile, jobs_say_more_than_what_all_are_told) {
  const BatchFolder folder;
  const Batch batch = folder.read(
      "assets = \"a.glb\"\nprompts = \"moss\"\n[options]\nsteps = 7\nstrength = 0.5\n"
      "[[jobs]]\n[[jobs]]\nname = \"strong one\"\noptions = { strength = 0.9, preset = \"fast\" }\n"
      "[[jobs]]\nassets = [\"c.glb\"]\nprompts = [\"rust\"]\nseeds = 4\n");
  EXPECT_EQ(names_of(batch), (std::vector<std::string>{"a_moss_0", "strong-one_a_moss_0", "c_rust_4"}));
  EXPECT_FLOAT_EQ(batch.jobs[0].config.edit.options.strength, 0.5f);
  EXPECT_FLOAT_EQ(batch.jobs[1].config.edit.options.strength, 0.9f);
  EXPECT_EQ(batch.jobs[1].config.edit.options.num_steps, 7) << "a preset is set before what it would change";
  EXPECT_EQ(batch.jobs[1].config.preset, pipeline::Preset::kFast);
}

TEST(JobsFile, names_the_line_of_what_is_wrong) {
  const BatchFolder folder;
  struct Case {
    std::string toml;
    std::vector<std::string> says;
  };
  const std::string usual = "assets = \"a.glb\"\nprompts = \"moss\"\n";
  for (const Case& one : std::vector<Case>{
           {"assets = [\"a.glb\"\nprompts", {"jobs.toml:3", "TOML"}},
           {usual + "colour = 1\n", {"jobs.toml:4", "'colour'", "prompts"}},
           {usual + "strength = 0.5\n", {"jobs.toml:4", "'strength'", "[options]"}},
           {"prompts = \"moss\"\n", {"assets"}},
           {"assets = \"a.glb\"\n", {"prompts"}},
           {"assets = \"a.glb\"\nprompts = [\"moss\", \" \"]\n", {"jobs.toml:3", "'prompts'"}},
           {"assets = \"DIR/*.none\"\nprompts = \"moss\"\n", {"jobs.toml:2", "*.none"}},
           {"assets = [\n\"a.glb\",\n\"DIR/*.none\"]\nprompts = \"moss\"\n", {"jobs.toml:4", "*.none"}},
           {"assets = \"a.glb\"\nprompts = [\n\"moss\",\n\"\"]\n", {"jobs.toml:5", "'prompts'"}},
           {usual + "seeds = [1,\n -1]\n", {"jobs.toml:5", "'seeds'"}},
           {usual + "seeds = []\n", {"jobs.toml:4", "'seeds'"}},
           {usual + "seeds = 1.5\n", {"jobs.toml:4", "'seeds'"}},
           {usual + "[options]\nstrength = 2\n", {"jobs.toml:5", "'strength'", "found '2'"}},
           {usual + "[options]\ncolor = 2\n", {"jobs.toml:5", "'color'"}},
           {usual + "[options]\nseed = 2\n", {"jobs.toml:5", "`seeds`"}},
           {usual + "[options]\noutput = \"x.glb\"\n", {"jobs.toml:5", "'output'"}},
           {usual + "[options]\nsteps = [2, 3]\n", {"jobs.toml:5", "one value"}},
           {usual + "[slurm]\narray = \"0-9\"\n", {"jobs.toml:5", "'array'"}},
           {usual + "[slurm]\n\"mem=1 --wrap\" = 1\n", {"jobs.toml:5", "long name"}},
           {usual + "[slurm]\nmem = \"1\\n2\"\n", {"jobs.toml:5", "one line"}},
           {usual + "[[jobs]]\nsteps = 3\n", {"jobs.toml:5", "'steps'", "[options]"}},
           {usual + "[[jobs]]\n[[jobs]]\nseeds = [3, 0]\n", {"two jobs", "a_moss_0", "name"}},
           {"assets = [\"x/a.glb\", \"y/a.glb\"]\nprompts = \"moss\"\n", {"x/a.glb", "y/a.glb"}}}) {
    const std::string said = folder.refusal(one.toml);
    for (const std::string& text : one.says)
      EXPECT_NE(said.find(text), std::string::npos) << text << " in " << said;
  }
}

TEST(Batch, makes_what_separate_runs_make_and_lists_what_failed) {
  const BatchFolder folder;
  folder.add_asset("one.glb");
  folder.add_asset("two.glb");
  write_file(folder.path() / "broken.glb", std::string_view("no asset"));
  folder.read(
      "assets = \"DIR/*.glb\"\nprompts = \"moss\"\n" + kSmall +
      "[[jobs]]\n[[jobs]]\nassets = [\"DIR/one.glb\"]\nname = \"odd\"\noptions = { resolution = 72 }\n"
      "[[jobs]]\nassets = [\"DIR/one.glb\"]\nprompts = [\"rust\"]\n");
  const ProcessResult result = folder.run();
  EXPECT_EQ(result.exit_code, 1);
  for (const char* text : {"broken_moss_0: ", "odd_one_moss_0: ", "multiple of 64", "2 of 5 jobs failed"})
    EXPECT_NE(result.error.find(text), std::string::npos) << text << " in " << result.error;

  for (const std::string name : {"one", "two"}) {
    const fs::path alone = folder.path() / "alone" / (name + ".glb");
    const ProcessResult run = patina({"enhance", (folder.path() / (name + ".glb")).string(), "-p", "moss",
                                      "-o", alone.string(), "--views", "4", "--resolution", "64", "--samples",
                                      "1", "--steps", "2", "--fit-iterations", "1", "--turntable", "0"});
    ASSERT_EQ(run.exit_code, 0) << run.error;
    EXPECT_EQ(read_file(alone), read_file(folder.results() / (name + "_moss_0") / (name + ".glb")));
  }

  const std::string page = read_text_file(folder.results() / "index.html");
  for (const char* text : {"<b>2</b> failed", "<b>3</b> done", "multiple of 64", "data:image/webp",
                           "href=\"two_moss_0/two.patina-run/report.html\"", "rust", "seed 0"})
    EXPECT_NE(page.find(text), std::string::npos) << text;
  EXPECT_FALSE(fs::exists(folder.results() / "broken_moss_0" / "broken.patina-run"));
}

TEST(Batch, leaves_what_is_done_and_goes_on_where_it_was_stopped) {
  const BatchFolder folder;
  folder.add_asset("one.glb");
  const Batch batch = folder.read("assets = \"DIR/one.glb\"\nprompts = [\"moss\", \"rust\"]\n" + kSmall);
  size_t started = 0;
  pipeline::BatchHooks hooks;
  hooks.on_job = [&](const pipeline::BatchJob&, pipeline::JobEvent event, const Failure&) {
    started += event == pipeline::JobEvent::kStarted;
  };
  hooks.progress_of = [&](const pipeline::BatchJob&) {
    pipeline::RunProgress progress;
    progress.stop_requested = [&] { return started == 2; };  // as Ctrl-C in the second job
    return progress;
  };
  hooks.stop_requested = [&] { return started == 2; };
  EXPECT_THROW(pipeline::run_batch(batch, {.at_once = 1}, hooks), Error);
  EXPECT_EQ(pipeline::read_record(batch.jobs[0]).state, pipeline::JobState::kDone);
  EXPECT_EQ(pipeline::read_record(batch.jobs[1]).state, pipeline::JobState::kBegun);

  ProcessResult result = folder.run({"--progress", "json"});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  std::istringstream lines(result.error);
  std::vector<std::string> told;
  json last;
  for (std::string line; std::getline(lines, line);) {
    last = json::parse(line);
    if (last["event"] == "job") told.push_back(last.value("job", "") + " " + last.value("state", ""));
    if (last["event"] == "stage") {
      EXPECT_EQ(last["job"], "one_rust_0");
    }
  }
  EXPECT_EQ(told,
            (std::vector<std::string>{"one_moss_0 reused", "one_rust_0 started", "one_rust_0 finished"}));
  EXPECT_EQ(last["event"], "result");
  EXPECT_TRUE(fs::exists(last.value("page", "")));

  // So that a job is made anew when the file that a model's name leads to has changed.
  const json record = json::parse(read_text_file(folder.results() / "one_moss_0" / "job.json"));
  EXPECT_TRUE(std::any_of(record["inputs"].begin(), record["inputs"].end(), [](const json& input) {
    return input["file"].get<std::string>().ends_with(".safetensors") && input["stamp"] != "";
  })) << record;
  // What was made from another asset is made anew.
  const fs::path output = batch.jobs[0].config.output;
  EXPECT_TRUE(pipeline::is_done(batch.jobs[0]));
  fs::last_write_time(folder.path() / "one.glb", fs::file_time_type::clock::now() + std::chrono::hours(1));
  EXPECT_FALSE(pipeline::is_done(batch.jobs[0]));
}

TEST(Batch, jobs_of_one_asset_are_rendered_once) {
  const BatchFolder folder;
  folder.add_asset("one.glb");
  folder.add_asset("two.glb");
  const Batch batch =
      folder.read("assets = \"DIR/*.glb\"\nprompts = [\"moss\", \"rust\"]\n" + kSmall +
                  "[[jobs]]\n[[jobs]]\nassets = \"DIR/one.glb\"\nprompts = \"ice\"\nseeds = 3\n");
  std::vector<std::string> told;
  pipeline::BatchHooks hooks;
  hooks.progress_of = [&](const pipeline::BatchJob& job) {
    pipeline::RunProgress progress;
    progress.on_stage = [&](std::string_view stage, pipeline::StageEvent event) {
      if (stage != "render" || event == pipeline::StageEvent::kFinished) return;
      told.push_back(job.name + (event == pipeline::StageEvent::kReused ? " takes" : " renders"));
    };
    return progress;
  };
  EXPECT_TRUE(pipeline::run_batch(batch, {.at_once = 1}, hooks).empty());
  EXPECT_EQ(told, (std::vector<std::string>{"one_moss_0 renders", "two_moss_0 renders", "one_ice_3 renders",
                                            "one_rust_0 takes", "two_rust_0 takes"}));
  const fs::path alone = folder.path() / "alone" / "one.glb";
  const ProcessResult run = patina({"enhance", (folder.path() / "one.glb").string(), "-p", "rust", "-o",
                                    alone.string(), "--views", "4", "--resolution", "64", "--samples", "1",
                                    "--steps", "2", "--fit-iterations", "1", "--turntable", "0"});
  ASSERT_EQ(run.exit_code, 0) << run.error;
  EXPECT_EQ(read_file(alone), read_file(folder.results() / "one_rust_0" / "one.glb"));
}

TEST(Batch, tasks_share_the_jobs_and_each_is_in_one) {
  const BatchFolder folder;
  folder.read("assets = [\"DIR/1.glb\", \"DIR/2.glb\", \"DIR/3.glb\"]\nprompts = \"moss\"\n" + kSmall);
  std::vector<std::string> failed;
  for (const char* task : {"0/2", "1/2"}) {
    const ProcessResult result = folder.run({"--task", task});
    EXPECT_EQ(result.exit_code, 1);
    for (const char* name : {"1_moss_0: ", "2_moss_0: ", "3_moss_0: "})
      if (result.error.find(std::string("failed  ") + name) != std::string::npos) failed.emplace_back(name);
  }
  EXPECT_EQ(failed, (std::vector<std::string>{"1_moss_0: ", "2_moss_0: ", "3_moss_0: "}));
  for (const char* wrong : {"2/2", "-1/2", "1", "a/b", "0/0"})
    EXPECT_EQ(folder.run({"--task", wrong}).exit_code, 2) << wrong;
}

TEST(Batch, a_job_that_another_process_works_on_is_left_alone) {
  const BatchFolder folder;
  folder.add_asset("one.glb");
  const Batch batch = folder.read("assets = \"DIR/one.glb\"\nprompts = \"moss\"\n" + kSmall);
  const pipeline::RunFolder other(pipeline::run_folder_path(batch.jobs[0].config));
  const ProcessResult result = folder.run();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.error.find("another patina"), std::string::npos) << result.error;
  EXPECT_EQ(pipeline::read_record(batch.jobs[0]).state, pipeline::JobState::kWaiting);
}

TEST(Batch, says_without_running_what_is_done) {
  const BatchFolder folder;
  const Batch batch = folder.read("assets = [\"DIR/1.glb\", \"DIR/2.glb\"]\nprompts = \"moss\"\n" + kSmall);
  EXPECT_EQ(folder.run({"--task", "0/2"}).exit_code, 1);
  const ProcessResult result = folder.run({"--collect"});
  EXPECT_EQ(result.exit_code, 1);
  for (const char* text : {"failed  1_moss_0: ", "1.glb", "0 done, 1 failed, 1 not finished"})
    EXPECT_NE(result.error.find(text), std::string::npos) << text << " in " << result.error;
  const std::string page = read_text_file(folder.results() / "index.html");
  EXPECT_NE(page.find("<b>1</b> waiting"), std::string::npos);
  EXPECT_EQ(folder.run({"--collect", "--task", "0/2"}).exit_code, 2);
  EXPECT_EQ(folder.run({"--chunk", "2"}).exit_code, 2);
  EXPECT_EQ(folder.run({"--preset", "fast"}).exit_code, 2) << "it stands in the file";
}

TEST(Slurm, writes_what_sbatch_takes) {
  EXPECT_EQ(app::ranges_of({}), "");
  EXPECT_EQ(app::ranges_of({3}), "3");
  EXPECT_EQ(app::ranges_of({0, 1, 2, 5, 7, 8}), "0-2,5,7-8");

  const BatchFolder folder;
  const app::JobsFile file = folder.read_all(
      "assets = \"DIR/1.glb\"\nprompts = \"moss\"\n[slurm]\ncpus-per-task = 8\npartition = \"a b\"\n"
      "exclusive = true\nrequeue = false\n");
  const app::SlurmArray array{.jobs_file = "/x/it's.toml",
                              .num_tasks = 9,
                              .task_list = {1, 2, 4},
                              .at_once = 1,
                              .options = file.slurm};
  const std::string script = app::slurm_script(file.batch, array, "/opt/patina", "/home/so'me one");
  for (const char* line :
       {"#!/bin/sh\n", "#SBATCH --array='1-2,4'\n", "#SBATCH --chdir='/home/so'\\''me one'\n",
        "#SBATCH --cpus-per-task='8'\n", "#SBATCH --partition='a b'\n", "#SBATCH --exclusive\n",
        "exec '/opt/patina' batch '/x/it'\\''s.toml' --task \"$SLURM_ARRAY_TASK_ID/9\" "})
    EXPECT_NE(script.find(line), std::string::npos) << line << " in " << script;
  EXPECT_EQ(script.find("requeue"), std::string::npos) << script;
  for (const char* odd : {"/back\\slash", "/two\nlines"})
    EXPECT_THROW(app::slurm_script(file.batch, array, "/opt/patina", odd), Error) << odd;
}

// A program of this name that answers as Slurm's would.
void stand_in_for(const fs::path& program, const std::string& script) {
  write_file(program, "#!/bin/sh\n" + script + "\n");
  fs::permissions(program, fs::perms::owner_all);
}

TEST(Slurm, is_given_the_tasks_that_have_something_to_do) {
  const BatchFolder folder;
  folder.add_asset("1.glb");
  folder.read("assets = [\"DIR/1.glb\", \"DIR/2.glb\", \"DIR/3.glb\"]\nprompts = \"moss\"\n" + kSmall);
  EXPECT_EQ(folder.run({"--task", "0/3"}).exit_code, 0);
  stand_in_for(folder.path() / "sbatch", "echo '17;cluster'");
  stand_in_for(folder.path() / "squeue", "echo '17_0 waits'");
  const std::string usual_path = std::getenv("PATH");
  ::setenv("PATH", (folder.path().string() + ":" + usual_path).c_str(), 1);

  const ProcessResult result = folder.run({"--slurm"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.error.find("array 17: 2 of 3 jobs in 2 tasks"), std::string::npos) << result.error;
  EXPECT_NE(read_text_file(folder.results() / "slurm" / "array.sh").find("--array='1-2'\n"),
            std::string::npos);

  const ProcessResult again = folder.run({"--slurm", "--chunk", "2"});
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_NE(again.error.find("still queued"), std::string::npos) << again.error;

  stand_in_for(folder.path() / "squeue", "echo 'Invalid job id'; exit 1");
  stand_in_for(folder.path() / "sbatch", "echo 'no such partition'; exit 1");
  const ProcessResult refused = folder.run({"--slurm"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.error.find("no such partition"), std::string::npos) << refused.error;
  ::setenv("PATH", usual_path.c_str(), 1);
}

}  // namespace
}  // namespace patina::test
