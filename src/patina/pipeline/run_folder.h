// The run folder: everything between asset and result, on disk, so that a stage whose inputs have not changed
// is not run again, a killed run continues, and an artist can edit pictures between two stages.
//
//   config.json          every option's value, version, asset
//   stages.json          per stage: the key of its inputs, its outputs, seconds, peak memory, metrics
//   views/  detail/  textures/  metrics.json  report.html  turntable.webp
//   variants/            edits to choose from, each in a run folder of its own
//   preview/             preview.html, while textures are fitted: what they show so far and the loss;
//                        the textures of a fit that was stopped
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/pipeline/run_progress.h"

namespace patina::pipeline {

/// What a stage left behind besides its files.
struct StageRecord {
  std::string name;
  std::string key;                   // hash of everything the stage read; empty: it was killed while it wrote
  std::vector<std::string> outputs;  // paths relative to the run folder
  std::vector<std::string> hashes;   // of the outputs as the stage wrote them
  double seconds = 0;                // with those spent before the last checkpoint of a run that was killed
  double peak_rss_mb = 0;  // largest resident memory of the process until the stage ended; while the stage
                           // ran, where the program resets the kernel's mark when a stage starts
  nlohmann::json metrics = nlohmann::json::object();
  std::vector<std::string> warnings;  // shown again in the report
};

/// One process at a time owns a run folder: the constructor takes a lock that ends with the process. A folder
/// that the constructor made goes again with the object if no stage left anything in it: a run that was
/// refused leaves nothing behind.
class RunFolder {
 public:
  /// Makes the folder if it is missing. Throws Error{kUsage} for a folder that holds other things, Error{kIo}
  /// if it cannot be written or another process holds it.
  explicit RunFolder(const std::filesystem::path& path);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path file(std::string_view relative) const { return path_ / relative; }
  /// Where the running stage writes an output of that name. From the first one on, what an earlier run of the
  /// stage has left is no longer whole, so its record ends: a run that is killed here is not taken for it.
  std::filesystem::path output(std::string_view relative);

  /// Runs `work` unless the last run of the stage had the same key and all its outputs are still there.
  /// `work` writes its files and returns their paths relative to the folder, with metrics and warnings.
  /// Records and returns the stage.
  struct StageResult {
    std::vector<std::string> outputs;
    nlohmann::json metrics = nlohmann::json::object();
    std::vector<std::string> warnings;
  };
  const StageRecord& run_stage(std::string_view name, const std::string& key, const RunProgress& progress,
                               const std::function<StageResult()>& work);

  /// Whether outputs that were changed by hand stay in place when their stage runs again. By default they
  /// make room for the new ones, and a copy is kept beside: "edited_01.by-hand.png".
  void keep_what_was_changed_by_hand(bool keep) { keep_ = keep; }

  /// Removes everything that stages have made here.
  void clear();

  /// Records of the stages that have run, in the order of the flow; nullptr if `name` has not.
  const std::vector<StageRecord>& stages() const { return stages_; }
  const StageRecord* stage(std::string_view name) const;

  /// Takes over a stage from a run that has run it, outputs and record, unless it is here already. The
  /// stage is then skipped as if it had run here. Does nothing if `from` has not run it, or where outputs of
  /// its own were changed by hand and are kept; else copies of these stay beside.
  void adopt_stage(const RunFolder& from, std::string_view name);

  /// Partial results of a long stage, kept under the stage's key: a checkpoint written for other inputs is
  /// not returned. Both are for the `work` of run_stage: time and memory spent until the checkpoint go with
  /// it into the stage's record. A checkpoint that cannot be written is a warning: the stage goes on.
  void save_checkpoint(std::string_view stage, const std::string& key, int step,
                       const std::vector<uint8_t>& bytes) const;
  struct SavedCheckpoint {
    int step = 0;
    std::vector<uint8_t> bytes;
  };
  std::optional<SavedCheckpoint> load_checkpoint(std::string_view stage, const std::string& key);

 private:
  /// The lock on an open file; whoever holds the object holds the folder.
  class Lock {
   public:
    explicit Lock(const std::filesystem::path& folder);
    ~Lock();
    Lock(const Lock&) = delete;
    Lock& operator=(const Lock&) = delete;

   private:
    int file_;
  };
  bool is_complete(const StageRecord& stage) const;
  bool is_unused() const;
  StageRecord* find_record(std::string_view name);
  void write_records() const;
  struct ChangedByHand {
    std::string output, copy;
  };
  std::vector<ChangedByHand> copy_what_was_changed_by_hand(const StageRecord& stage) const;
  void set_record(StageRecord record);
  double seconds_so_far() const;
  double peak_so_far_mb() const;

  std::filesystem::path path_;
  std::vector<std::filesystem::path> made_;  // folders that were not there before, innermost first
  std::optional<Lock> lock_;
  bool keep_ = false;
  std::vector<StageRecord> stages_;
  // Of the stage that is running: its name (empty: none is), when it started here, and what a killed run had
  // spent on it.
  std::string running_;
  const RunProgress* progress_ = nullptr;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  double earlier_seconds_ = 0, earlier_peak_mb_ = 0;
};

/// A JSON file; throws Error{kFormat} naming the file where it is not JSON.
nlohmann::json read_json(const std::filesystem::path& path);
void write_json(const std::filesystem::path& path, const nlohmann::json& json);

}  // namespace patina::pipeline
