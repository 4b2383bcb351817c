// What the user sees of a batch: one bar over all jobs and a line for each that ends, or events that name
// their job (docs/progress.md).
#pragma once

#include <mutex>
#include <string>

#include "console.h"
#include "patina/pipeline/batch.h"

namespace patina::app {

class BatchConsole {
 public:
  BatchConsole(Style style, size_t num_jobs);

  /// Functions that tell here, from several threads; valid as long as the object.
  pipeline::BatchHooks hooks();
  void result(const std::vector<Made>& made);
  /// How many jobs are done, and which failed, for people.
  void summary(const std::vector<pipeline::FailedJob>& failed);

 private:
  void on_job(const pipeline::BatchJob& job, pipeline::JobEvent event, const Failure& reason);
  pipeline::RunProgress progress_of(const pipeline::BatchJob& job);
  void draw();

  bool json_, quiet_;
  std::mutex mutex_;  // guards what follows
  Console console_;
  pipeline::RunProgress told_;  // the console's functions
  size_t num_to_run_, num_reused_ = 0, num_finished_ = 0;
  double stages_done_ = 0;  // of jobs that run here
};

}  // namespace patina::app
