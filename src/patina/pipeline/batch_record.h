// job.json: what has become of a job of a batch, and what its result was made from.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/pipeline/batch.h"

namespace patina::pipeline {

/// The job's own folder.
std::filesystem::path job_folder(const BatchJob& job);

/// A hash of the job's options and of the names, sizes and dates of the files that they name.
std::string job_key(const BatchJob& job);

/// `inputs` are files that options need not name: those that the asset refers to, and those of the model,
/// which names and model folders lead to.
void write_record(const BatchJob& job, const JobRecord& record, const std::string& key = {},
                  const std::vector<std::filesystem::path>& inputs = {});

/// Whether the result is there and was made under `key` from the inputs as they are.
bool is_done(const BatchJob& job, const std::string& key);

}  // namespace patina::pipeline
