#include "patina/pipeline/batch.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <thread>

#include <fmt/format.h>

#include "patina/base/clock.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/nn/threads.h"
#include "patina/pipeline/batch_record.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/variants.h"
#include "patina/report/batch_page.h"
#include "patina/report/scale.h"
#include "patina/report/webp.h"

namespace patina::pipeline {

namespace fs = std::filesystem;

namespace {

constexpr int kPictureSide = 320;
constexpr float kPictureQuality = 82;
constexpr double kIndexSeconds = 10;  // the page is written anew at most this often while jobs run

fs::path picture_file(const BatchJob& job) {
  return job_folder(job) / "picture.webp";
}

// The first view of what the job made, small: the enhanced asset, or of a draft the edited view.
void write_picture(const BatchJob& job, const RunFolder& run) {
  const auto write = [&](std::string_view stage, std::string_view prefix) {
    const StageRecord* record = run.stage(stage);
    if (!record) return false;
    for (const std::string& output : record->outputs) {
      if (!output.starts_with(prefix)) continue;
      const Image image = report::as_rgb(read_image(run.file(output)));
      const double scale =
          std::min(1.0, static_cast<double>(kPictureSide) / std::max(image.width, image.height));
      const Image small = report::scaled_srgb(image, std::max(1, static_cast<int>(image.width * scale)),
                                              std::max(1, static_cast<int>(image.height * scale)));
      write_file(picture_file(job), report::encode_webp(small, kPictureQuality));
      return true;
    }
    return false;
  };
  if (only_edits(job.config) || !write("report", "report/rendered_")) write("detail", "detail/edited_");
}

// What the views of a job depend on: jobs with the same text have the same ones.
std::string views_text(const BatchJob& job) {
  Config config = job.config;
  settle(config);
  std::string text = fs::absolute(config.inputs.asset).string();
  for (const Option& option : options())
    if (option.parts & (kInputs | kRender)) text += "\n" + option.get(config).dump();
  return text;
}

// The order in which views are made early that others wait for: of each asset one job, then of each the next.
void alternate_views(const Batch& batch, std::vector<size_t>& order) {
  std::map<std::string, size_t> counts;
  std::map<size_t, size_t> rank;
  for (const size_t i : order) rank[i] = counts[views_text(batch.jobs[i])]++;
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return rank[a] < rank[b]; });
}

// Jobs of one model after another.
std::vector<size_t> in_order_of_models(const Batch& batch, size_t first, size_t count) {
  std::vector<const diffusion::ModelPaths*> models;
  std::vector<std::vector<size_t>> groups;
  for (size_t i = first; i < batch.jobs.size() && i - first < count; ++i) {
    const diffusion::ModelPaths& paths = batch.jobs[i].config.edit.model;
    const auto same = [&](const diffusion::ModelPaths* other) { return *other == paths; };
    const auto known = std::find_if(models.begin(), models.end(), same);
    const auto group = static_cast<size_t>(known - models.begin());
    if (known == models.end()) models.push_back(&paths), groups.emplace_back();
    groups[group].push_back(i);
  }
  std::vector<size_t> order;
  for (std::vector<size_t>& group : groups) {
    alternate_views(batch, group);
    order.insert(order.end(), group.begin(), group.end());
  }
  return order;
}

// Copies the views that another job has rendered; the render stage then finds them as its own. They are
// rendered anew where someone works there, or where a picture was changed by hand.
void take_views(const fs::path& rendered, RunFolder& run) {
  if (run.stage("render")) return;
  try {
    const RunFolder from(rendered);
    const StageRecord* record = from.stage("render");
    if (!record || record->hashes.size() != record->outputs.size()) return;
    for (size_t i = 0; i < record->outputs.size(); ++i)
      if (hash_file(from.file(record->outputs[i])) != record->hashes[i]) return;
    run.adopt_stage(from, "render");
  } catch (const std::exception&) {
    return;
  }
}

// What the threads that work on a batch share.
class BatchRun {
 public:
  BatchRun(const Batch& batch, const BatchHooks& hooks) : batch_(batch), hooks_(hooks) {}

  std::vector<FailedJob> run(const BatchOptions& options);

 private:
  void work();
  void run_job(size_t index);
  void try_job(const BatchJob& job);
  void note_views(const BatchJob& job);
  fs::path folder_with_views(const BatchJob& job);
  void tell(const BatchJob& job, JobEvent event, const Failure& reason = {}) const {
    if (hooks_.on_job) hooks_.on_job(job, event, reason);
  }
  bool stopped() const { return hooks_.stop_requested && hooks_.stop_requested(); }
  void refresh_index();

  const Batch& batch_;
  const BatchHooks& hooks_;
  ModelShelf models_{/*keeps=*/true};
  std::vector<size_t> left_;  // jobs that are not done
  std::atomic<size_t> next_ = 0;
  std::mutex mutex_;                          // guards what follows
  std::map<size_t, FailedJob> failed_;        // by index
  std::map<std::string, fs::path> rendered_;  // run folders that have views, by views_text()
  Clock::time_point index_written_ = Clock::now();
};

std::vector<FailedJob> BatchRun::run(const BatchOptions& options) {
  for (const size_t i : in_order_of_models(batch_, options.first, options.count))
    if (is_done(batch_.jobs[i])) {
      note_views(batch_.jobs[i]);
      tell(batch_.jobs[i], JobEvent::kReused);
    } else {
      left_.push_back(i);
    }
  // LibTorch keeps the number of its threads for each thread that calls it.
  const int network_threads = nn::num_network_threads();
  const size_t num_workers = std::min(left_.size(), static_cast<size_t>(std::max(1, options.at_once)));
  std::vector<std::thread> workers;
  for (size_t w = 0; w < num_workers; ++w)
    workers.emplace_back([this, network_threads] {
      nn::set_num_network_threads(network_threads);
      work();
    });
  for (std::thread& worker : workers) worker.join();
  write_index(batch_);
  if (stopped()) throw Error(ErrorCode::kInterrupted, "", "stopped; the same command goes on from here");
  std::vector<FailedJob> failed;
  for (auto& [index, job] : failed_) failed.push_back(std::move(job));
  return failed;
}

void BatchRun::note_views(const BatchJob& job) {
  const std::string text = views_text(job);
  const std::lock_guard lock(mutex_);
  rendered_.emplace(text, run_folder_path(job.config));
}

fs::path BatchRun::folder_with_views(const BatchJob& job) {
  const std::string text = views_text(job);
  const std::lock_guard lock(mutex_);
  const auto found = rendered_.find(text);
  return found == rendered_.end() ? fs::path() : found->second;
}

void BatchRun::work() {
  for (size_t i; !stopped() && (i = next_++) < left_.size();) {
    if (i + 1 == left_.size()) models_.stop_keeping();  // the last jobs fit without it
    run_job(left_[i]);
    refresh_index();
  }
}

void BatchRun::refresh_index() {
  const std::lock_guard lock(mutex_);
  if (seconds_since(index_written_) < kIndexSeconds) return;
  index_written_ = Clock::now();
  try {
    write_index(batch_);
  } catch (const std::exception&) {
    // The page at the end tells what is wrong.
  }
}

void BatchRun::run_job(size_t index) {
  const BatchJob& job = batch_.jobs[index];
  tell(job, JobEvent::kStarted);
  try {
    try_job(job);
    note_views(job);
    tell(job, JobEvent::kFinished);
  } catch (...) {
    const Failure failure = current_failure();
    if (failure.kind == name_of(ErrorCode::kInterrupted)) return;  // it goes on the next time
    tell(job, JobEvent::kFailed, failure);
    const std::lock_guard lock(mutex_);
    failed_.emplace(index, FailedJob{job.name, failure});
  }
}

void BatchRun::try_job(const BatchJob& job) {
  RunFolder run(run_folder_path(job.config));  // held by this job alone from here on
  const std::string key = job_key(job);
  if (is_done(job, key)) return;  // by another process, meanwhile
  const auto start = Clock::now();
  try {
    write_record(job, {.state = JobState::kBegun, .reason = {}});
    const RunProgress progress = hooks_.progress_of ? hooks_.progress_of(job) : RunProgress{};
    if (const fs::path rendered = folder_with_views(job); !rendered.empty()) take_views(rendered, run);
    const std::vector<fs::path> inputs = enhance(job.config, run, progress, models_);
    write_picture(job, run);
    write_record(job, {.state = JobState::kDone, .reason = {}, .seconds = seconds_since(start)}, key, inputs);
  } catch (...) {
    const Failure failure = current_failure();
    if (failure.kind != name_of(ErrorCode::kInterrupted))
      write_record(job, {.state = JobState::kFailed, .reason = failure, .seconds = seconds_since(start)});
    throw;
  }
}

// `path` as a link of the page leads to it; empty where it is not there.
fs::path from_index(const Batch& batch, const fs::path& path) {
  std::error_code failure;
  return fs::exists(path, failure) ? path.lexically_relative(batch.folder) : fs::path();
}

report::CardState card_state(JobState state) {
  switch (state) {
    case JobState::kWaiting:
      return report::CardState::kWaiting;
    case JobState::kBegun:
      return report::CardState::kBegun;
    case JobState::kDone:
      return report::CardState::kDone;
    case JobState::kFailed:
      return report::CardState::kFailed;
  }
  return report::CardState::kWaiting;
}

}  // namespace

void require_different_outputs(const Batch& batch) {
  std::map<fs::path, const BatchJob*> owners;
  for (const BatchJob& job : batch.jobs)
    for (const fs::path& path : {job.config.output, run_folder_path(job.config)}) {
      const auto [owner, is_new] = owners.emplace(fs::absolute(path).lexically_normal(), &job);
      if (!is_new)
        throw Error(ErrorCode::kUsage, path.string(),
                    fmt::format("two jobs would write this: {} as “{}”, and {} as “{}”. Give the jobs of one "
                                "of them a name of their own (name = \"…\")",
                                printable(owner->second->config.inputs.asset.string()),
                                printable(owner->second->config.edit.options.prompt),
                                printable(job.config.inputs.asset.string()),
                                printable(job.config.edit.options.prompt)));
    }
}

std::vector<FailedJob> run_batch(const Batch& batch, const BatchOptions& options, const BatchHooks& hooks) {
  return BatchRun(batch, hooks).run(options);
}

fs::path write_index(const Batch& batch) {
  report::BatchPage page{.title = batch.folder.filename().string(), .cards = {}};
  for (const BatchJob& job : batch.jobs) {
    const JobRecord record = read_record(job);
    const diffusion::EditOptions& edit = job.config.edit.options;
    report::BatchCard card{.name = job.name,
                           .asset = job.config.inputs.asset.filename().string(),
                           .prompt = edit.prompt,
                           .negative_prompt = edit.negative_prompt.value_or(""),
                           .seed = edit.seed,
                           .state = card_state(record.state),
                           .reason = {},
                           .result = {},
                           .page = {},
                           .picture = {},
                           .seconds = record.seconds};
    if (record.state == JobState::kFailed) card.reason = as_text(record.reason);
    if (record.state == JobState::kDone) {
      const fs::path run = run_folder_path(job.config);
      card.result = from_index(batch, job.config.output);
      card.page = from_index(
          batch, only_edits(job.config) ? run / "variants" / "variants.html" : run / "report.html");
      std::error_code failure;
      if (fs::exists(picture_file(job), failure)) card.picture = read_file(picture_file(job));
    }
    page.cards.push_back(std::move(card));
  }
  fs::path path = batch.folder / "index.html";
  report::write_batch_page(path, page);
  return path;
}

}  // namespace patina::pipeline
