#include "patina/pipeline/batch_record.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "patina/base/files.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/option_kinds.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/variants.h"

namespace patina::pipeline {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::array kStateNames{"waiting", "begun", "done", "failed"};

fs::path record_file(const BatchJob& job) {
  return job_folder(job) / "job.json";
}

// Tells whether a file changed without reading it; "" where there is none. Of a folder, which is a model,
// the stamps of its files and those of its parts.
std::string stamp_of(const fs::path& file) {
  std::error_code failure;
  if (fs::is_directory(file, failure)) {
    std::vector<std::string> stamps;
    for (fs::recursive_directory_iterator at(file, failure), end; !failure && at != end;
         at.increment(failure)) {
      if (at.depth() > 0) at.disable_recursion_pending();
      if (at->is_regular_file(failure)) stamps.push_back(at->path().string() + " " + stamp_of(at->path()));
    }
    std::sort(stamps.begin(), stamps.end());
    return fmt::format("{}", fmt::join(stamps, "\n"));
  }
  if (!fs::is_regular_file(file, failure)) return "";
  const auto size = fs::file_size(file, failure);
  const auto time = fs::last_write_time(file, failure).time_since_epoch().count();
  return failure ? "" : fmt::format("{} {}", size, time);
}

// Stamps of the files that an option's value names. It may be a path, or one after "MATERIAL=" and before
// ":WEIGHT"; texts that name no file have no stamp.
void add_stamps(std::string& text, const json& value) {
  if (value.is_array())
    for (const json& one : value) add_stamps(text, one);
  if (!value.is_string()) return;
  std::string named = value.get<std::string>();
  const size_t equals = named.find('='), colon = named.rfind(':');
  for (const std::string& candidate :
       {named, named.substr(equals == std::string::npos ? 0 : equals + 1), named.substr(0, colon),
        equals < colon && colon != std::string::npos && equals != std::string::npos
            ? named.substr(equals + 1, colon - equals - 1)
            : std::string()})
    text += stamp_of(option_kinds::path_of_text(candidate)) + "\n";
}

}  // namespace

fs::path job_folder(const BatchJob& job) {
  return job.config.output.parent_path();
}

std::string job_key(const BatchJob& job) {
  Config config = job.config;
  config.num_threads = 0;  // changes no result
  settle(config);
  const json options = to_json(config);
  std::string text =
      fmt::format("{}\n{}\n{}\n{}\n", PATINA_VERSION, fs::absolute(config.inputs.asset).string(),
                  stamp_of(config.inputs.asset), options.dump());
  for (const auto& [name, value] : options.items())
    if (name != "output" && name != "run" && name != "model-dir") add_stamps(text, value);
  return hash_text(text);
}

JobRecord read_record(const BatchJob& job) {
  const fs::path file = record_file(job);
  JobRecord record;
  std::error_code failure;
  if (!fs::exists(file, failure)) return record;
  const json values = json::parse(read_text_file(file), nullptr, /*allow_exceptions=*/false);
  if (!values.is_object()) return record;  // damaged: as if nobody had begun
  try {
    for (size_t i = 0; i < kStateNames.size(); ++i)
      if (values.at("state") == kStateNames[i]) record.state = static_cast<JobState>(i);
    record.seconds = values.value("seconds", 0.0);
    if (values.contains("reason"))
      record.reason = {values["reason"].at("kind"), values["reason"].at("about"),
                       values["reason"].at("text")};
  } catch (const json::exception&) {
    return {};
  }
  return record;
}

void write_record(const BatchJob& job, const JobRecord& record, const std::string& key,
                  const std::vector<fs::path>& inputs) {
  json values = {{"job", job.name},
                 {"asset", option_kinds::text_of_path(job.config.inputs.asset)},
                 {"prompt", job.config.edit.options.prompt},
                 {"seed", job.config.edit.options.seed},
                 {"state", kStateNames.at(static_cast<size_t>(record.state))},
                 {"seconds", record.seconds}};
  if (record.state == JobState::kFailed)
    values["reason"] = {
        {"kind", record.reason.kind}, {"about", record.reason.about}, {"text", record.reason.text}};
  if (record.state == JobState::kDone) {
    values["key"] = key;
    values["inputs"] = json::array();
    for (const fs::path& input : inputs)
      values["inputs"].push_back(
          {{"file", option_kinds::text_of_path(fs::absolute(input))}, {"stamp", stamp_of(input)}});
  }
  write_json(record_file(job), values);
}

bool is_done(const BatchJob& job, const std::string& key) {
  const fs::path file = record_file(job);
  std::error_code failure;
  if (!fs::exists(file, failure)) return false;
  const json values = json::parse(read_text_file(file), nullptr, /*allow_exceptions=*/false);
  if (!values.is_object() || values.value("state", json()) != "done" || values.value("key", json()) != key)
    return false;
  try {
    for (const json& input : values.at("inputs"))
      if (stamp_of(option_kinds::path_of_text(input.at("file").get<std::string>())) != input.at("stamp"))
        return false;
  } catch (const json::exception&) {
    return false;
  }
  const fs::path run = run_folder_path(job.config);
  return fs::exists(only_edits(job.config) ? run / "variants" / "variants.html" : job.config.output, failure);
}

bool is_done(const BatchJob& job) {
  return is_done(job, job_key(job));
}

}  // namespace patina::pipeline
