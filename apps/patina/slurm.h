// A batch as a job array of Slurm: the script that each task runs, and its submission.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "patina/pipeline/batch.h"

namespace patina::app {

/// Options of sbatch by their long names, from [slurm] of a job file. One without a value has an empty one.
using SlurmOptions = std::vector<std::pair<std::string, std::string>>;

struct SlurmArray {
  std::filesystem::path jobs_file;
  size_t num_tasks = 0;           // into which the jobs are parted
  std::vector<size_t> task_list;  // those that have something left to do, ascending
  int at_once = 2;                // jobs that a task works on at the same time
  int num_threads = 0;            // of a task; 0: the processors that Slurm gives it
  SlurmOptions options;
};

/// "0-4,7,9-11" of ascending numbers.
std::string ranges_of(const std::vector<size_t>& numbers);

/// The script that sbatch is given. `program` and `folder` (the working folder) are absolute.
std::string slurm_script(const pipeline::Batch& batch, const SlurmArray& array,
                         const std::filesystem::path& program, const std::filesystem::path& folder);

/// Writes the script into <batch folder>/slurm/ and gives it to sbatch. Returns Slurm's number of the array.
/// Throws Error{kUsage} while an earlier array of this folder is still queued or runs, and Error{kNotFound,
/// kIo} with what sbatch says.
std::string submit(const pipeline::Batch& batch, const SlurmArray& array);

}  // namespace patina::app
