// What both trainings share: how long a run goes on, its rate, its log, and the hand that stops it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

namespace patina::train_mini {

struct RunOptions {
  double minutes = 60;
  double rate = 3e-4;
  bool settle = false;         // the rate falls to zero over the run
  double warm_up_steps = 300;  // of the training, in which the rate rises
  uint64_t seed = 0;
  int64_t workers = 1;  // threads that share a step
};

/// Counts the steps of one run. `log` gets a line of JSON now and then, which is also printed.
class Run {
 public:
  Run(const RunOptions& options, std::filesystem::path log, int64_t first_step);

  int64_t step() const { return step_; }
  void next() { ++step_; }
  bool finished() const;
  /// Warms up over the first steps of the training, falls at the end of a run that settles.
  double rate() const;
  /// True every `seconds`, for checkpoints.
  bool due(double seconds);
  /// Gathers means of `values` and writes them every twenty seconds.
  void log(const std::map<std::string, double>& values);

 private:
  double seconds() const;

  RunOptions options_;
  std::filesystem::path log_;
  int64_t step_, logged_step_;
  std::chrono::steady_clock::time_point start_;
  double last_due_ = 0, last_log_ = 0;
  std::map<std::string, std::pair<double, int>> sums_;
};

/// Makes Run::finished() true at SIGINT and SIGTERM, so that the state is written.
void stop_on_signals();

}  // namespace patina::train_mini
