// What the user sees while patina works: a bar with the time left on a terminal, a line now and then in a
// log, warnings, and how Ctrl-C becomes a stop.
#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "patina/base/progress.h"

namespace patina::app {

enum class Verbosity { kQuiet, kNormal };

/// Draws to standard error. One at a time; finish() or the destructor ends a bar that is still drawn.
class Console {
 public:
  explicit Console(Verbosity verbosity);
  ~Console();
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;

  /// Functions that draw here; valid as long as the console.
  Progress progress();
  /// A line of its own.
  void say(std::string_view text);
  void finish();

 private:
  using Clock = std::chrono::steady_clock;
  void update(std::string_view task, double done, double total);
  void draw(double done, double total);

  bool quiet_, is_terminal_;
  std::string task_;
  Clock::time_point start_, last_drawn_;
  double first_done_ = 0, last_done_ = 0, last_total_ = 0;
  bool bar_drawn_ = false;
};

/// Installs a handler for Ctrl-C and termination: the first asks the running stage to stop and keep what it
/// has, the second ends at once.
void install_stop_handler();

/// "1 h 02 min", "3 min 20 s", "12 s".
std::string format_duration(double seconds);

}  // namespace patina::app
