// patina batch JOBS.toml: many runs with one model, here or as tasks of many machines.
#include <fmt/format.h>

#include "batch_console.h"
#include "commands.h"
#include "jobs_file.h"
#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/base/text.h"
#include "patina/nn/threads.h"
#include "patina/pipeline/batch.h"
#include "patina/pipeline/options.h"
#include "slurm.h"

namespace patina::app {
namespace {

struct OwnOptions {
  std::string task, at_once = "2", chunk;
  bool slurm = false, collect = false;
};

// A job array has at most so many tasks where Slurm's MaxArraySize is as it comes.
constexpr size_t kUsualTasks = 1000;

// The jobs of task K of N: the same number of neighbours for each, as near as it goes.
pipeline::BatchOptions jobs_of_task(size_t task, size_t num_tasks, size_t num_jobs) {
  const size_t first = task * num_jobs / num_tasks;
  return {.first = first, .count = (task + 1) * num_jobs / num_tasks - first};
}

pipeline::BatchOptions parsed_task(const std::string& text, size_t num_jobs) {
  const size_t slash = text.find('/');
  const auto task = parse_number<size_t>(text.substr(0, slash));
  const auto num_tasks =
      slash == std::string::npos ? std::nullopt : parse_number<size_t>(text.substr(slash + 1));
  if (!task || !num_tasks || *task >= *num_tasks || *num_tasks > 1000000)
    throw Error(ErrorCode::kUsage, "task",
                fmt::format("expected K/N with K from 0 to N-1, e.g. 0/8, found '{}'", printable(text)));
  return jobs_of_task(*task, *num_tasks, num_jobs);
}

void run(const pipeline::Batch& batch, const GivenOptions& given, const OwnOptions& own) {
  pipeline::Config machine;
  apply_options(given, machine);
  pipeline::BatchOptions options = own.task.empty()
                                       ? pipeline::BatchOptions{.first = 0, .count = batch.jobs.size()}
                                       : parsed_task(own.task, batch.jobs.size());
  options.at_once = parse_count("at-once", own.at_once);
  nn::set_num_threads(machine.num_threads);
  BatchConsole console(given.style(), options.count);
  const std::vector<pipeline::FailedJob> failed = pipeline::run_batch(batch, options, console.hooks());
  console.summary(failed);
  const std::filesystem::path page = batch.folder / "index.html";
  if (!failed.empty())
    throw Error(
        ErrorCode::kJobs, page.string(),
        fmt::format("{} of {} jobs failed; the same command tries them again", failed.size(), options.count));
  console.result({{"page", page}});
}

// Says how far the batch is, whoever runs it.
void collect(const pipeline::Batch& batch, const GivenOptions& given) {
  Console console(given.style());
  const std::filesystem::path page = pipeline::write_index(batch);
  size_t num_done = 0, num_failed = 0;
  for (const pipeline::BatchJob& job : batch.jobs) {
    if (pipeline::is_done(job)) {
      ++num_done;
      continue;
    }
    const pipeline::JobRecord record = pipeline::read_record(job);
    if (record.state != pipeline::JobState::kFailed) continue;
    ++num_failed;
    console.say(fmt::format("failed  {}: {}", job.name, as_text(record.reason)));
  }
  const size_t num_left = batch.jobs.size() - num_done - num_failed;
  const std::string counts =
      fmt::format("{} done, {} failed, {} not finished", num_done, num_failed, num_left);
  if (num_done < batch.jobs.size()) throw Error(ErrorCode::kJobs, page.string(), counts);
  console.say(counts);
  console.result({{"page", page}});
}

// Hands the tasks that have something to do to Slurm.
void submit_tasks(const JobsFile& file, const GivenOptions& given, const OwnOptions& own) {
  pipeline::Config machine;
  apply_options(given, machine);
  Console console(given.style());
  const size_t num_jobs = file.batch.jobs.size();
  const size_t chunk = own.chunk.empty() ? (num_jobs + kUsualTasks - 1) / kUsualTasks
                                         : static_cast<size_t>(parse_count("chunk", own.chunk));
  SlurmArray array{.jobs_file = std::filesystem::absolute(given.positional),
                   .num_tasks = (num_jobs + chunk - 1) / chunk,
                   .task_list = {},
                   .at_once = parse_count("at-once", own.at_once),
                   .num_threads = machine.num_threads,
                   .options = file.slurm};
  size_t num_left = 0;
  for (size_t task = 0; task < array.num_tasks; ++task) {
    const pipeline::BatchOptions jobs = jobs_of_task(task, array.num_tasks, num_jobs);
    size_t left = 0;
    for (size_t i = jobs.first; i < jobs.first + jobs.count; ++i)
      left += !pipeline::is_done(file.batch.jobs[i]);
    if (left > 0) array.task_list.push_back(task);
    num_left += left;
  }
  const std::filesystem::path page = pipeline::write_index(file.batch);
  if (num_left == 0) {
    console.say(fmt::format("all {} jobs are done", num_jobs));
    return console.result({{"page", page}});
  }
  const std::string number = submit(file.batch, array);
  console.say(fmt::format("submitted as array {}: {} of {} jobs in {} tasks", number, num_left, num_jobs,
                          array.task_list.size()));
  console.result({{"page", page}, {"script", file.batch.folder / "slurm" / "array.sh"}});
}

// Refuses options of which one would have no effect.
void require_one_way(const OwnOptions& own) {
  if (own.slurm + own.collect + !own.task.empty() > 1)
    throw Error(ErrorCode::kUsage, own.slurm ? "slurm" : "collect",
                "goes without the others of --task, --slurm and --collect");
  if (!own.chunk.empty() && !own.slurm)
    throw Error(ErrorCode::kUsage, "chunk", "is for --slurm: how many jobs a task of the array has");
}

}  // namespace

void add_batch(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "batch",
      "Enhance many assets: every asset with every prompt and seed that a file lists, with one model in "
      "memory. The same command goes on where a stopped one was.");
  const auto own = std::make_shared<OwnOptions>();
  command
      ->add_option("--at-once", own->at_once,
                   "Jobs that are worked on at the same time: one edits while others render and fit. [2]")
      ->type_name("N")
      ->expected(1)
      ->group("Batch");
  command
      ->add_option("--task", own->task,
                   "Run only part K of N of the jobs, with K from 0 to N-1, so that several machines share "
                   "them.")
      ->type_name("K/N")
      ->expected(1)
      ->group("Batch");
  command
      ->add_flag("--slurm", own->slurm,
                 "Run nothing here: submit a job array of Slurm for the jobs that are not done.")
      ->group("Batch");
  command
      ->add_option("--chunk", own->chunk,
                   "With --slurm: jobs of one task of the array. [1; of more than 1000 jobs as many as make "
                   "1000 tasks]")
      ->type_name("N")
      ->expected(1)
      ->group("Batch");
  command
      ->add_flag("--collect", own->collect,
                 "Run nothing: say what is done and what failed, and write the index page anew.")
      ->group("Batch");
  const auto given = add_options(*command, "JOBS.toml", "Assets, prompts, seeds and options: docs/batch.md.",
                                 pipeline::kMachine, {"config", "preset"});
  command->callback([=] {
    find_positional(*given);
    require_one_way(*own);
    const JobsFile file = read_jobs(given->positional);
    if (own->collect) return collect(file.batch, *given);
    if (own->slurm) return submit_tasks(file, *given, *own);
    run(file.batch, *given, *own);
  });
}

}  // namespace patina::app
