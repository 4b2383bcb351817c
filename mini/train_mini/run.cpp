#include "run.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>

namespace patina::train_mini {
namespace {

constexpr double kLogSeconds = 20;
volatile std::sig_atomic_t stop_requested = 0;

}  // namespace

Run::Run(const RunOptions& options, std::filesystem::path log, int64_t first_step)
    : options_(options),
      log_(std::move(log)),
      step_(first_step),
      logged_step_(first_step),
      start_(std::chrono::steady_clock::now()) {}

double Run::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

bool Run::finished() const {
  return stop_requested || seconds() > options_.minutes * 60;
}

double Run::rate() const {
  const double warm = std::min(1.0, (static_cast<double>(step_) + 1) / options_.warm_up_steps);
  const double share = std::min(1.0, seconds() / (options_.minutes * 60));
  return options_.rate * warm * (options_.settle ? 0.5 + 0.5 * std::cos(M_PI * share) : 1.0);
}

bool Run::due(double every) {
  if (seconds() - last_due_ < every) return false;
  last_due_ = seconds();
  return true;
}

void Run::log(const std::map<std::string, double>& values) {
  for (const auto& [name, value] : values) {
    sums_[name].first += value;
    ++sums_[name].second;
  }
  const double now = seconds();
  if (now - last_log_ < kLogSeconds) return;
  char text[64];
  std::snprintf(text, sizeof text, "{\"step\": %lld, \"minutes\": %.1f, \"steps_per_second\": %.2f",
                static_cast<long long>(step_), now / 60,
                static_cast<double>(step_ - logged_step_) / (now - last_log_));
  std::string line = text;
  for (const auto& [name, sum] : sums_) {
    std::snprintf(text, sizeof text, ", \"%s\": %.5f", name.c_str(), sum.first / sum.second);
    line += text;
  }
  line += "}";
  std::ofstream(log_, std::ios::app) << line << "\n";
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
  sums_.clear();
  last_log_ = now;
  logged_step_ = step_;
}

void stop_on_signals() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { stop_requested = 1; });
}

}  // namespace patina::train_mini
