#include "console.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/mapped_files.h"
#include "peak_memory.h"

namespace patina::app {
namespace {

using nlohmann::json;
using pipeline::StageEvent;

constexpr double kRedrawSeconds = 0.1;  // on a terminal
constexpr double kEventSeconds = 0.5;   // an event of progress
constexpr double kLogSeconds = 15.0;    // a line in a log
constexpr double kQuietSeconds = 1.0;   // jobs shorter than this draw nothing
constexpr int kBarWidth = 24;

// Signal handlers can reach nothing but globals, and call little but write().
std::atomic<int> g_stop_requests{0};
std::atomic<bool> g_says_that_it_stops{false};

void write_in_handler(const char* text) {
  if (::write(STDERR_FILENO, text, std::strlen(text)) < 0) return;  // nobody is left to tell
}

extern "C" void on_stop_signal(int signal) {
  if (g_stop_requests.fetch_add(1) > 0) std::_Exit(128 + signal);
  if (g_says_that_it_stops) write_in_handler("\nstopping after this step; once more ends at once\n");
}

// Reading a mapped file that has become shorter, or whose disk fails, ends in this signal.
extern "C" void on_bus_error(int, siginfo_t* info, void*) {
  const char* file = mapped_file_at(info->si_addr);
  write_in_handler("patina: ");
  write_in_handler(file ? file : "a file");
  write_in_handler(": became shorter, or could not be read, while it was in use\n");
  std::_Exit(1);
}

// Of the terminal on standard error; 0 where it does not tell.
size_t terminal_columns() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

// Failures are ignored: a full disk or a closed terminal must not end a run of hours.
void write_error_stream(std::string_view text) {
  (void)std::fwrite(text.data(), 1, text.size(), stderr);
  (void)std::fflush(stderr);
}

const char* name_of(StageEvent event) {
  switch (event) {
    case StageEvent::kStarted:
      return "started";
    case StageEvent::kReused:
      return "reused";
    case StageEvent::kFinished:
      return "finished";
  }
  return "";
}

}  // namespace

void write_event(const json& event) {
  write_error_stream(event.dump(-1, ' ', false, json::error_handler_t::replace) + "\n");
}

void install_signal_handlers() {
  std::signal(SIGINT, on_stop_signal);
  std::signal(SIGTERM, on_stop_signal);
  struct sigaction bus {};
  bus.sa_sigaction = on_bus_error;
  bus.sa_flags = SA_SIGINFO;
  ::sigaction(SIGBUS, &bus, nullptr);
}

std::string progress_line(const std::string& task, double share, const std::string& text, size_t columns) {
  const std::string numbers = fmt::format("{:3.0f} %  {}", 100 * share, text);
  // A line that wraps would not be overwritten by the next one.
  if (columns > 0 && std::max<size_t>(task.size(), 14) + kBarWidth + numbers.size() + 2 >= columns)
    return (task + numbers).substr(0, columns - 1);
  std::string bar;
  for (int i = 0; i < kBarWidth; ++i) bar += i < std::lround(share * kBarWidth) ? "━" : "─";
  return fmt::format("{:<14} {} {}", task, bar, numbers);
}

std::string format_duration(double seconds) {
  const auto s = static_cast<long>(std::lround(std::max(seconds, 0.0)));
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

Console::Console(Style style)
    : json_(style == Style::kJson || style == Style::kQuietJson),
      quiet_(style == Style::kQuiet || style == Style::kQuietJson),
      is_terminal_(!json_ && ::isatty(STDERR_FILENO) != 0) {
  g_says_that_it_stops = !json_ && !quiet_;
}

Console::~Console() {
  g_says_that_it_stops = false;
  finish();
}

pipeline::RunProgress Console::progress() {
  pipeline::RunProgress progress;
  progress.on_update = [this](std::string_view task, double done, double total) {
    update(task, done, total);
  };
  progress.on_warning = [this](std::string_view text) {
    if (json_ && !quiet_)
      write_event({{"event", "warning"}, {"text", printable(text, 1000)}});
    else
      say(fmt::format("note: {}", printable(text, 1000)));
  };
  progress.on_stage = [this](std::string_view stage, StageEvent event) {
    if (event == StageEvent::kStarted) reset_peak_memory();
    stage_ = event == StageEvent::kStarted ? stage : "";
    if (json_ && !quiet_) write_event({{"event", "stage"}, {"stage", stage}, {"state", name_of(event)}});
  };
  progress.on_preview = [this](const std::filesystem::path& file) {
    if (json_ && !quiet_)
      write_event(
          {{"event", "preview"}, {"stage", stage_}, {"file", std::filesystem::absolute(file).string()}});
  };
  progress.stop_requested = [] { return g_stop_requests.load() > 0; };
  return progress;
}

void Console::say(std::string_view text) {
  if (quiet_ || json_) return;
  if (is_terminal_ && bar_drawn_) write_error_stream("\r\x1b[K");
  write_error_stream(fmt::format("{}\n", text));
  if (is_terminal_ && bar_drawn_) draw(last_done_, last_total_);
}

void Console::result(const std::vector<Made>& made) {
  finish();
  if (json_) {
    json event = {{"event", "result"}};
    for (const Made& m : made) event[m.name] = std::filesystem::absolute(m.path).string();
    write_event(event);
    return;
  }
  size_t width = 0;
  for (const Made& m : made) width = std::max(width, m.name.size());
  for (const Made& m : made) say(fmt::format("{:<{}}  {}", m.name, width, m.path.string()));
}

double Console::elapsed() const {
  return std::chrono::duration<double>(Clock::now() - start_).count();
}

double Console::seconds_left(double done, double total) const {
  const double rate = (done - first_done_) / std::max(elapsed(), 1e-3);
  return rate > 0 ? (total - done) / rate : -1;
}

void Console::update(std::string_view task, double done, double total) {
  if (quiet_ || !(total > 0)) return;
  const Clock::time_point now = Clock::now();
  if (task == task_ && done >= total && last_done_ >= total) return;  // said already
  const bool is_new = task != task_ || done < last_done_;
  if (is_new) {
    finish();
    task_ = task;
    start_ = last_drawn_ = now;
    first_done_ = done;
  }
  last_done_ = done;
  last_total_ = total;
  const double since_drawn = std::chrono::duration<double>(now - last_drawn_).count();
  const bool due = since_drawn >= (json_ ? kEventSeconds : is_terminal_ ? kRedrawSeconds : kLogSeconds);
  if (json_ ? !is_new && !due && done < total : elapsed() < kQuietSeconds || (!due && done < total)) return;
  last_drawn_ = now;
  draw(done, total);
}

void Console::draw(double done, double total) {
  const double share = std::clamp(done / total, 0.0, 1.0);
  const double left = seconds_left(done, total);
  if (json_) {
    write_event({{"event", "progress"},
                 {"stage", stage_},
                 {"task", task_},
                 {"share", share},
                 {"seconds_left", left >= 0 ? json(std::round(left * 10) / 10) : json()}});
    return;
  }
  const std::string text = share >= 1  ? "took " + format_duration(elapsed())
                           : left >= 0 ? format_duration(left) + " left"
                                       : "";
  if (is_terminal_) {
    write_error_stream("\r\x1b[K" + progress_line(task_, share, text, terminal_columns()));
    bar_drawn_ = true;
  } else {
    write_error_stream(fmt::format("{:<14} {:3.0f} %  {}\n", task_, 100 * share, text));
  }
}

void Console::finish() {
  if (bar_drawn_) write_error_stream("\n");
  bar_drawn_ = false;
  task_.clear();
  last_done_ = 0;
}

}  // namespace patina::app
