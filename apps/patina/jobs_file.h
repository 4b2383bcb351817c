// JOBS.toml: assets × prompts × seeds, and the options of `patina enhance` for all and for some
// (docs/batch.md).
#pragma once

#include <filesystem>

#include "patina/pipeline/batch.h"
#include "slurm.h"

namespace patina::app {

struct JobsFile {
  pipeline::Batch batch;
  SlurmOptions slurm;  // [slurm]
};

/// Reads the file and lists its jobs, in its order, patterns in that of their names. Paths are relative to
/// the current folder, as on the command line. Throws Error{kUsage} that names file and line, what was
/// expected and what was found, also for a pattern that no file matches and for jobs with the same output.
JobsFile read_jobs(const std::filesystem::path& file);

}  // namespace patina::app
