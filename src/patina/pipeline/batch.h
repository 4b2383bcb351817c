// Many runs as one piece of work: they share one model, several are worked on at the same time, what fails
// stops no other, and what is done is not done again.
//
//   <folder>/index.html              every job: picture, words, seed, state, the way to its report
//   <folder>/<job>/job.json          its state, and what its result was made from
//   <folder>/<job>/picture.webp      its first view, small
//   <folder>/<job>/kettle.glb        the result, and kettle.patina-run beside it
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "patina/base/failure.h"
#include "patina/pipeline/config.h"
#include "patina/pipeline/run_progress.h"

namespace patina::pipeline {

/// One run. config.output lies in the job's own folder, which also holds the run folder.
struct BatchJob {
  std::string name;
  Config config;
};

struct Batch {
  std::filesystem::path folder;
  std::vector<BatchJob> jobs;
};

/// Throws Error{kUsage} naming two jobs that would write the same output.
void require_different_outputs(const Batch& batch);

enum class JobState {
  kWaiting,  // nobody has begun it
  kBegun,    // somebody works on it, or was killed while doing so
  kDone,
  kFailed,
};

/// What the job's folder says of it.
struct JobRecord {
  JobState state = JobState::kWaiting;
  Failure reason;      // of kFailed
  double seconds = 0;  // of work, of the last try
};
JobRecord read_record(const BatchJob& job);

/// What happens to a job. kReused: it was done before, from the same files with the same options.
enum class JobEvent { kReused, kStarted, kFinished, kFailed };

/// May be called from several threads at the same time.
struct BatchHooks {
  std::function<void(const BatchJob& job, JobEvent event, const Failure& reason)> on_job;
  std::function<RunProgress(const BatchJob& job)> progress_of;
  std::function<bool()> stop_requested;
};

struct BatchOptions {
  size_t first = 0, count = ~size_t{0};  // the part of the jobs that is run here
  int at_once = 2;                       // jobs that are worked on at the same time
};

struct FailedJob {
  std::string name;
  Failure reason;
};

/// Runs the jobs that are not done, each as enhance() does, to the same bytes. Runs of other processes on the
/// same folder are left alone. Returns what failed, in the order of the jobs. Throws Error{kInterrupted} once
/// a stop was asked for, and Error{kIo} for a folder that cannot be written.
std::vector<FailedJob> run_batch(const Batch& batch, const BatchOptions& options, const BatchHooks& hooks);

/// Whether the job's result is there, made from the files that lie there now with the options of `job`.
bool is_done(const BatchJob& job);

/// Shows all jobs as their folders say → index.html. Returns its path.
std::filesystem::path write_index(const Batch& batch);

}  // namespace patina::pipeline
