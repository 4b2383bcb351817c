// patina batch JOBS.toml: many runs with one model.
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

namespace patina::app {
namespace {

struct OwnOptions {
  std::string task, at_once = "2";
};

// The jobs of task K of N: the same number of neighbours for each, as near as it goes.
void choose_task(const std::string& text, size_t num_jobs, pipeline::BatchOptions& options) {
  const size_t slash = text.find('/');
  const auto task = parse_number<size_t>(text.substr(0, slash));
  const auto num_tasks =
      slash == std::string::npos ? std::nullopt : parse_number<size_t>(text.substr(slash + 1));
  if (!task || !num_tasks || *task >= *num_tasks || *num_tasks > 1000000)
    throw Error(ErrorCode::kUsage, "task",
                fmt::format("expected K/N with K from 0 to N-1, e.g. 0/8, found '{}'", printable(text)));
  options.first = *task * num_jobs / *num_tasks;
  options.count = (*task + 1) * num_jobs / *num_tasks - options.first;
}

void run(const GivenOptions& given, const OwnOptions& own) {
  pipeline::Config machine;
  apply_options(given, machine);
  const pipeline::Batch batch = read_jobs(given.positional);
  pipeline::BatchOptions options{.first = 0, .count = batch.jobs.size()};
  options.at_once = parse_count("at-once", own.at_once);
  if (!own.task.empty()) choose_task(own.task, batch.jobs.size(), options);
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
  const auto given = add_options(*command, "JOBS.toml", "Assets, prompts, seeds and options: docs/batch.md.",
                                 pipeline::kMachine, {"config"});
  command->callback([=] {
    find_positional(*given);
    run(*given, *own);
  });
}

}  // namespace patina::app
