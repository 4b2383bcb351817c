#include "patina/pipeline/run_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>

#include <fmt/format.h>

#include "patina/asset/json_view.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/half_written.h"
#include "patina/base/memory.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::array kOwnFiles{".lock", "config.json"};

double peak_memory_mb() {
  return static_cast<double>(peak_resident_bytes()) / 1048576;
}

json to_json(const StageRecord& stage) {
  return {{"name", stage.name},       {"key", stage.key},          {"outputs", stage.outputs},
          {"hashes", stage.hashes},   {"seconds", stage.seconds},  {"peak_rss_mb", stage.peak_rss_mb},
          {"metrics", stage.metrics}, {"warnings", stage.warnings}};
}

// Outputs are removed when their stage runs again: a folder that came from elsewhere must not name others.
void require_inside(const std::string& output) {
  const fs::path path = fs::path(output).lexically_normal();
  if (path.empty() || path.is_absolute() || *path.begin() == "..")
    throw Error(ErrorCode::kFormat, output, "lies outside of the run folder");
}

StageRecord stage_from_json(const json& j) {
  for (const json& output : j.at("outputs")) require_inside(output);
  return {.name = j.at("name"),
          .key = j.at("key"),
          .outputs = j.at("outputs"),
          .hashes = j.value("hashes", std::vector<std::string>()),
          .seconds = j.at("seconds"),
          .peak_rss_mb = j.at("peak_rss_mb"),
          .metrics = j.at("metrics"),
          .warnings = j.at("warnings")};
}

std::string checkpoint_name(std::string_view stage) {
  return fmt::format(".{}.checkpoint", stage);
}

}  // namespace

json read_json(const fs::path& path) {
  return asset::parse_json(read_text_file(path), path.string());
}

void write_json(const fs::path& path, const json& values) {
  write_file(path, values.dump(2, ' ', false, json::error_handler_t::replace) + "\n");
}

RunFolder::Lock::Lock(const fs::path& folder)
    : file_(::open((folder / ".lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
  if (file_ < 0)
    throw Error(ErrorCode::kIo, folder.string(),
                fmt::format("the run folder cannot be written: {}", std::strerror(errno)));
  if (::flock(file_, LOCK_EX | LOCK_NB) != 0) {
    ::close(file_);
    throw Error(ErrorCode::kIo, folder.string(),
                "another patina works in this run folder; wait for it, or choose another folder");
  }
}

RunFolder::Lock::~Lock() {
  ::close(file_);
}

RunFolder::RunFolder(const fs::path& path) : path_(path) {
  std::error_code failure;
  for (fs::path at = fs::absolute(path_); at.has_relative_path() && !fs::exists(at, failure);
       at = at.parent_path())
    made_.push_back(at);
  if (fs::is_directory(path_, failure) && !fs::is_empty(path_, failure) && !fs::exists(path_ / ".lock") &&
      !fs::exists(path_ / "stages.json"))
    throw Error(ErrorCode::kUsage, "run",
                fmt::format("'{}' holds other files and is not a run folder; choose a new or an empty one",
                            printable(path_.string())));
  fs::create_directories(path_, failure);
  if (failure)
    throw Error(ErrorCode::kIo, path_.string(), "the run folder cannot be made: " + failure.message());
  lock_.emplace(path_);
  const fs::path record = path_ / "stages.json";
  if (!fs::exists(record)) return;
  remove_half_written(path_);  // never in a folder of something else
  const auto refuse = [&](const std::string& fault) {
    throw Error(ErrorCode::kFormat, record.string(),
                fmt::format("is not a record of stages ({}); remove it to run all stages again", fault));
  };
  try {
    for (const json& stage : json::parse(read_text_file(record))) stages_.push_back(stage_from_json(stage));
  } catch (const json::exception& e) {
    refuse(asset::json_fault(e));
  } catch (const Error& e) {
    if (e.code() != ErrorCode::kFormat) throw;
    refuse(e.what());
  }
}

RunFolder::~RunFolder() {
  if (!made_.empty() && is_unused()) {
    std::error_code ignored;
    for (const char* file : kOwnFiles) fs::remove(path_ / file, ignored);
    // Folders in which something else lies by now stay.
    for (const fs::path& folder : made_) fs::remove(folder, ignored);
  }
}

// Whether nothing lies here but what every run leaves before its first stage.
bool RunFolder::is_unused() const {
  std::error_code failure;
  for (const fs::directory_entry& entry : fs::directory_iterator(path_, failure))
    if (std::find(kOwnFiles.begin(), kOwnFiles.end(), entry.path().filename()) == kOwnFiles.end())
      return false;
  return !failure;
}

StageRecord* RunFolder::find_record(std::string_view name) {
  const auto found =
      std::find_if(stages_.begin(), stages_.end(), [&](const StageRecord& s) { return s.name == name; });
  return found == stages_.end() ? nullptr : &*found;
}

const StageRecord* RunFolder::stage(std::string_view name) const {
  const auto found = std::find_if(stages_.begin(), stages_.end(),
                                  [&](const StageRecord& s) { return s.name == name && !s.key.empty(); });
  return found == stages_.end() ? nullptr : &*found;
}

fs::path RunFolder::output(std::string_view relative) {
  if (StageRecord* earlier = find_record(running_); earlier && !earlier->key.empty()) {
    // The names stay, so that what the next run does not make again is removed. Their hashes go: a file that
    // differs from them need not have been changed by hand.
    *earlier = {.name = running_,
                .key = {},
                .outputs = std::move(earlier->outputs),
                .hashes = {},
                .metrics = json::object(),
                .warnings = {}};
    write_records();
  }
  return path_ / relative;
}

bool RunFolder::is_complete(const StageRecord& stage) const {
  return std::all_of(stage.outputs.begin(), stage.outputs.end(),
                     [&](const std::string& output) { return fs::exists(path_ / output); });
}

// A stage takes its old place; what follows it is judged by its own key.
void RunFolder::set_record(StageRecord record) {
  if (StageRecord* place = find_record(record.name))
    *place = std::move(record);
  else
    stages_.push_back(std::move(record));
  write_records();
}

void RunFolder::write_records() const {
  json list = json::array();
  for (const StageRecord& stage : stages_) list.push_back(to_json(stage));
  write_json(path_ / "stages.json", list);
}

double RunFolder::seconds_so_far() const {
  return earlier_seconds_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

double RunFolder::peak_so_far_mb() const {
  return std::max(earlier_peak_mb_, peak_memory_mb());
}

const StageRecord& RunFolder::run_stage(std::string_view name, const std::string& key,
                                        const RunProgress& progress,
                                        const std::function<StageResult()>& work) {
  if (const StageRecord* last = stage(name); last && last->key == key && is_complete(*last)) {
    for (const std::string& warning : last->warnings) progress.warn(warning);
    progress.tell_stage(name, StageEvent::kReused);
    return *last;
  }
  progress.throw_if_stopped();
  progress.tell_stage(name, StageEvent::kStarted);
  start_ = std::chrono::steady_clock::now();
  earlier_seconds_ = earlier_peak_mb_ = 0;
  const StageRecord before = find_record(name) ? *find_record(name) : StageRecord{};
  const std::vector<ChangedByHand> changed = copy_what_was_changed_by_hand(before);
  running_ = name, progress_ = &progress;
  const auto stop_running = [this](void*) { running_.clear(), progress_ = nullptr; };
  const std::unique_ptr<void, decltype(stop_running)> until_the_end(this, stop_running);
  StageResult result = work();
  std::error_code ignored;
  for (const std::string& output : before.outputs)  // e.g. textures of materials that are no longer chosen
    if (std::find(result.outputs.begin(), result.outputs.end(), output) == result.outputs.end())
      fs::remove(path_ / output, ignored);
  std::vector<std::string> hashes;
  for (const std::string& output : result.outputs) hashes.push_back(hash_file(path_ / output));
  for (const auto& [output, copy] : changed) {
    if (keep_) fs::copy_file(path_ / copy, path_ / output, fs::copy_options::overwrite_existing);
    progress.warn(fmt::format("{} was changed by hand{} {}", output,
                              keep_ ? " and is kept; a copy is" : "; that picture is now", copy));
  }
  set_record({.name = std::string(name),
              .key = key,
              .outputs = std::move(result.outputs),
              .hashes = std::move(hashes),
              .seconds = seconds_so_far(),
              .peak_rss_mb = peak_so_far_mb(),
              .metrics = std::move(result.metrics),
              .warnings = std::move(result.warnings)});
  fs::remove(path_ / checkpoint_name(name), ignored);
  progress.tell_stage(name, StageEvent::kFinished);
  return *stage(name);
}

std::vector<RunFolder::ChangedByHand> RunFolder::copy_what_was_changed_by_hand(
    const StageRecord& stage) const {
  std::vector<ChangedByHand> changed;
  for (size_t i = 0; i < stage.hashes.size() && i < stage.outputs.size(); ++i) {
    const fs::path file = path_ / stage.outputs[i];
    if (!fs::exists(file) || hash_file(file) == stage.hashes[i]) continue;
    fs::path copy = file;
    for (int n = 1; n == 1 || fs::exists(copy); ++n)
      copy.replace_filename(fmt::format("{}.by-hand{}{}", file.stem().string(),
                                        n == 1 ? "" : fmt::format("-{}", n), file.extension().string()));
    fs::copy_file(file, copy);
    changed.push_back({stage.outputs[i], fs::relative(copy, path_).string()});
  }
  return changed;
}

void RunFolder::clear() {
  std::error_code ignored;
  for (const StageRecord& stage : stages_) {
    for (const std::string& output : stage.outputs) fs::remove(path_ / output, ignored);
    fs::remove(path_ / checkpoint_name(stage.name), ignored);
  }
  for (const char* made : {"preview", "variants", "metrics.json", "report.html", "config.json"})
    fs::remove_all(path_ / made, ignored);
  stages_.clear();
  write_json(path_ / "stages.json", json::array());
}

void RunFolder::adopt_stage(const RunFolder& from, std::string_view name) {
  const StageRecord* record = from.stage(name);
  if (!record || !from.is_complete(*record)) return;
  if (const StageRecord* own = stage(name)) {
    if (own->key == record->key && is_complete(*own)) return;
    if (!copy_what_was_changed_by_hand(*own).empty() && keep_) return;
  }
  for (const std::string& output : record->outputs) {
    fs::create_directories((path_ / output).parent_path());
    write_file_with(path_ / output, [&](const fs::path& temporary) {
      fs::copy_file(from.path_ / output, temporary, fs::copy_options::overwrite_existing);
    });
  }
  set_record(*record);
}

void RunFolder::save_checkpoint(std::string_view stage, const std::string& key, int step,
                                const std::vector<uint8_t>& bytes) const {
  const json values = {{"key", key},
                       {"step", step},
                       {"hash", hash_bytes(bytes)},
                       {"seconds", seconds_so_far()},
                       {"peak_rss_mb", peak_so_far_mb()}};
  const std::string header = values.dump() + "\n";
  std::vector<uint8_t> file(header.begin(), header.end());
  file.insert(file.end(), bytes.begin(), bytes.end());
  try {
    write_file(path_ / checkpoint_name(stage), file);
  } catch (const Error& e) {
    if (progress_)
      progress_->warn(fmt::format("{}; if the run is stopped, this stage starts anew", e.what()));
  }
}

std::optional<RunFolder::SavedCheckpoint> RunFolder::load_checkpoint(std::string_view stage,
                                                                     const std::string& key) {
  const fs::path path = path_ / checkpoint_name(stage);
  if (!fs::exists(path)) return std::nullopt;
  const std::vector<uint8_t> file = read_file(path, ~uint64_t{0});
  const auto line_end = std::find(file.begin(), file.end(), '\n');
  if (line_end == file.end()) return std::nullopt;
  try {
    const json header = json::parse(file.begin(), line_end);
    SavedCheckpoint saved{.step = header.at("step"), .bytes = {line_end + 1, file.end()}};
    if (header.at("key") != key || header.at("hash") != hash_bytes(saved.bytes)) return std::nullopt;
    earlier_seconds_ = header.at("seconds");
    earlier_peak_mb_ = header.at("peak_rss_mb");
    return saved;
  } catch (const json::exception&) {
    return std::nullopt;  // damaged: the stage starts anew
  }
}

}  // namespace patina::pipeline
