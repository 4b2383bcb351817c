// The diffusion model of a run: its files are found once and handed on, its networks are loaded by the first
// edit that needs them.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "patina/diffusion/model.h"
#include "patina/pipeline/settings.h"

namespace patina::pipeline {

class ResolvedModel {
 public:
  /// Finds and checks all files without loading weights. Throws Error{kUsage} where no model is named, and
  /// Error that names what is missing, broken or cannot run on this device.
  explicit ResolvedModel(const EditSettings& settings);
  ~ResolvedModel();
  ResolvedModel(ResolvedModel&&) noexcept;
  ResolvedModel& operator=(ResolvedModel&&) noexcept;

  /// Of the names, sizes and dates of all files: weights are gigabytes, these tell whether they changed.
  const std::string& hash() const;
  /// All of them, wherever names and model folders led to.
  const std::vector<std::filesystem::path>& files() const;

  /// The networks; loaded by the first call. They stay until unload(), after which they cannot be loaded
  /// again.
  const diffusion::Model& loaded();
  bool is_loaded() const;
  void unload();

  /// Waits until no other run works with the networks, and keeps them from others as long as the lock lives.
  /// Runs that share a model take it before loaded().
  std::unique_lock<std::mutex> alone();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The models of several runs: runs that ask for the same one share it, so that it is loaded once. May be
/// used by several threads.
class ModelShelf {
 public:
  /// A shelf that keeps a model has it ready for the next run until another model is asked for; else a model
  /// goes with the last run that holds it.
  explicit ModelShelf(bool keeps) : keeps_(keeps) {}

  /// Throws as ResolvedModel's constructor.
  std::shared_ptr<ResolvedModel> take(const EditSettings& settings);
  /// From now on nothing is kept.
  void stop_keeping();

 private:
  struct Known {
    diffusion::ModelPaths paths;
    diffusion::Dtype dtype;
    diffusion::Device device;
    bool low_memory;
    diffusion::Scheduler scheduler;  // checked with the files

    bool operator==(const Known&) const = default;
  };
  std::mutex mutex_;
  bool keeps_;
  Known known_{};
  std::weak_ptr<ResolvedModel> latest_;
  std::shared_ptr<ResolvedModel> kept_;
};

}  // namespace patina::pipeline
