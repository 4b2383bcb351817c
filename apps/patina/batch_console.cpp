#include "batch_console.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "patina/base/clock.h"

namespace patina::app {
namespace {

using nlohmann::json;
using pipeline::BatchJob;
using pipeline::JobEvent;
using pipeline::StageEvent;

constexpr double kStagesOfJob = 4;     // render, detail, fit, report
constexpr double kEventSeconds = 0.5;  // an event of progress, for each job

const char* name_of(JobEvent event) {
  switch (event) {
    case JobEvent::kReused:
      return "reused";
    case JobEvent::kStarted:
      return "started";
    case JobEvent::kFinished:
      return "finished";
    case JobEvent::kFailed:
      return "failed";
  }
  return "";
}

}  // namespace

BatchConsole::BatchConsole(Style style, size_t num_jobs)
    : json_(style == Style::kJson || style == Style::kQuietJson),
      quiet_(style == Style::kQuiet || style == Style::kQuietJson),
      console_(style),
      told_(console_.progress()),
      num_to_run_(num_jobs) {}

pipeline::BatchHooks BatchConsole::hooks() {
  return {.on_job = [this](const BatchJob& job, JobEvent event,
                           const Failure& reason) { on_job(job, event, reason); },
          .progress_of = [this](const BatchJob& job) { return progress_of(job); },
          .stop_requested = told_.stop_requested};
}

void BatchConsole::on_job(const BatchJob& job, JobEvent event, const Failure& reason) {
  const std::lock_guard lock(mutex_);
  if (json_) {
    if (quiet_) return;
    json told = {{"event", "job"}, {"job", job.name}, {"state", name_of(event)}};
    if (event == JobEvent::kFailed)
      told["reason"] = {{"kind", reason.kind}, {"about", reason.about}, {"text", reason.text}};
    write_event(told);
    return;
  }
  switch (event) {
    case JobEvent::kReused:
      --num_to_run_, ++num_reused_;
      break;
    case JobEvent::kStarted:
      break;
    case JobEvent::kFinished:
    case JobEvent::kFailed:
      ++num_finished_;
      console_.say(event == JobEvent::kFinished ? fmt::format("done    {}", job.name)
                                                : fmt::format("failed  {}: {}", job.name, as_text(reason)));
      break;
  }
  draw();
}

void BatchConsole::draw() {
  const double total = kStagesOfJob * static_cast<double>(num_to_run_);
  const double least = kStagesOfJob * static_cast<double>(num_finished_);
  if (num_to_run_ > 0)
    told_.update(fmt::format("{} of {} jobs", num_finished_, num_to_run_),
                 std::min(std::max(stages_done_, least), total), total);
}

pipeline::RunProgress BatchConsole::progress_of(const BatchJob& job) {
  struct Shown {
    std::string stage, task;
    Clock::time_point last;
  };
  const auto shown = std::make_shared<Shown>();
  const auto send = [this, name = job.name](json event) {
    const std::lock_guard lock(mutex_);
    if (quiet_) return;
    event["job"] = name;
    write_event(event);
  };
  pipeline::RunProgress progress;
  progress.stop_requested = told_.stop_requested;
  progress.on_warning = [this, send, name = job.name](std::string_view text) {
    if (json_) return send({{"event", "warning"}, {"text", printable(text, 1000)}});
    const std::lock_guard lock(mutex_);
    console_.say(fmt::format("note: {}: {}", name, printable(text, 1000)));
  };
  progress.on_stage = [this, send, shown](std::string_view stage, StageEvent event) {
    shown->stage = event == StageEvent::kStarted ? stage : "";
    if (json_) {
      const char* state = event == StageEvent::kStarted  ? "started"
                          : event == StageEvent::kReused ? "reused"
                                                         : "finished";
      return send({{"event", "stage"}, {"stage", stage}, {"state", state}});
    }
    if (event == StageEvent::kStarted || stage == "masks") return;
    const std::lock_guard lock(mutex_);
    stages_done_ += 1;
    draw();
  };
  progress.on_update = [this, send, shown](std::string_view task, double done, double total) {
    if (!json_ || !(total > 0)) return;
    const bool is_new = task != shown->task;
    if (!is_new && done < total && seconds_since(shown->last) < kEventSeconds) return;
    shown->task = task;
    shown->last = Clock::now();
    send({{"event", "progress"},
          {"stage", shown->stage},
          {"task", task},
          {"share", std::clamp(done / total, 0.0, 1.0)},
          {"seconds_left", json()}});
  };
  progress.on_preview = [this, send, shown](const std::filesystem::path& file) {
    if (json_)
      send({{"event", "preview"},
            {"stage", shown->stage},
            {"file", std::filesystem::absolute(file).string()}});
  };
  return progress;
}

void BatchConsole::result(const std::vector<Made>& made) {
  console_.result(made);
}

void BatchConsole::summary(const std::vector<pipeline::FailedJob>& failed) {
  console_.finish();
  console_.say(fmt::format("{} done{}{}", num_finished_ - failed.size() + num_reused_,
                           num_reused_ > 0 ? fmt::format(" ({} of them before)", num_reused_) : "",
                           failed.empty() ? "" : fmt::format(", {} failed:", failed.size())));
  for (const pipeline::FailedJob& job : failed)
    console_.say(fmt::format("  {}: {}", job.name, as_text(job.reason)));
}

}  // namespace patina::app
