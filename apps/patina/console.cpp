#include "console.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>

#include <fmt/format.h>

#include "patina/base/error.h"

namespace patina::app {
namespace {

constexpr double kRedrawSeconds = 0.1;  // on a terminal
constexpr double kLogSeconds = 15.0;    // a line in a log
constexpr double kQuietSeconds = 1.0;   // jobs shorter than this draw nothing
constexpr int kBarWidth = 24;

std::atomic<int> g_stop_requests{0};  // signal handlers can reach nothing but a global

extern "C" void on_stop_signal(int signal) {
  if (g_stop_requests.fetch_add(1) > 0) std::_Exit(128 + signal);
}

}  // namespace

void install_stop_handler() {
  std::signal(SIGINT, on_stop_signal);
  std::signal(SIGTERM, on_stop_signal);
}

std::string format_duration(double seconds) {
  const auto s = static_cast<long>(std::lround(std::max(seconds, 0.0)));
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

Console::Console(Verbosity verbosity)
    : quiet_(verbosity == Verbosity::kQuiet), is_terminal_(::isatty(STDERR_FILENO) != 0) {}

Console::~Console() {
  finish();
}

Progress Console::progress() {
  Progress progress;
  progress.on_update = [this](std::string_view task, double done, double total) {
    update(task, done, total);
  };
  progress.on_warning = [this](std::string_view text) {
    say(fmt::format("note: {}", printable(text, 1000)));
  };
  progress.stop_requested = [] { return g_stop_requests.load() > 0; };
  return progress;
}

void Console::say(std::string_view text) {
  if (quiet_) return;
  if (is_terminal_ && bar_drawn_) std::fputs("\r\x1b[K", stderr);
  fmt::print(stderr, "{}\n", text);
  if (is_terminal_ && bar_drawn_) draw(last_done_, last_total_);
}

void Console::update(std::string_view task, double done, double total) {
  if (quiet_ || !(total > 0)) return;
  const Clock::time_point now = Clock::now();
  if (task == task_ && done >= total && last_done_ >= total) return;  // said already
  if (task != task_ || done < last_done_) {
    finish();
    task_ = task;
    start_ = last_drawn_ = now;
    first_done_ = done;
  }
  last_done_ = done;
  last_total_ = total;
  const double since_drawn = std::chrono::duration<double>(now - last_drawn_).count();
  const double since_start = std::chrono::duration<double>(now - start_).count();
  const bool due = since_drawn >= (is_terminal_ ? kRedrawSeconds : kLogSeconds);
  if (since_start < kQuietSeconds || (!due && done < total)) return;
  last_drawn_ = now;
  draw(done, total);
}

void Console::draw(double done, double total) {
  const double share = std::clamp(done / total, 0.0, 1.0);
  const double elapsed = std::chrono::duration<double>(Clock::now() - start_).count();
  // The rate since the task began here, so that a resumed task does not promise too much.
  const double rate = (done - first_done_) / std::max(elapsed, 1e-3);
  const std::string left = share >= 1 ? "took " + format_duration(elapsed)
                           : rate > 0 ? format_duration((total - done) / rate) + " left"
                                      : "";
  if (is_terminal_) {
    const int filled = static_cast<int>(std::lround(share * kBarWidth));
    std::string bar;
    for (int i = 0; i < kBarWidth; ++i) bar += i < filled ? "━" : "─";
    fmt::print(stderr, "\r\x1b[K{:<14} {} {:3.0f} %  {}", task_, bar, 100 * share, left);
    std::fflush(stderr);
    bar_drawn_ = true;
  } else {
    fmt::print(stderr, "{:<14} {:3.0f} %  {}\n", task_, 100 * share, left);
  }
}

void Console::finish() {
  if (bar_drawn_) std::fputc('\n', stderr);
  bar_drawn_ = false;
  task_.clear();
  last_done_ = 0;
}

}  // namespace patina::app
