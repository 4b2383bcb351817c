// What the user sees while patina works: a bar with the time left on a terminal, a line now and then in a
// log, or events for programs (docs/progress.md); warnings; and how Ctrl-C becomes a stop.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/pipeline/run_progress.h"

namespace patina::app {

enum class Style { kPlain, kQuiet, kJson, kQuietJson };

/// Something that a command made: "asset", "report", and where it lies.
struct Made {
  std::string name;
  std::filesystem::path path;
};

/// Writes to standard error. One at a time; finish() or the destructor ends a bar that is still drawn. Text
/// that cannot be written is lost and stops nothing.
class Console {
 public:
  explicit Console(Style style);
  ~Console();
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;

  /// Functions that draw here; valid as long as the console.
  pipeline::RunProgress progress();
  /// A line of its own, for people.
  void say(std::string_view text);
  /// The command is done, and this is what it made.
  void result(const std::vector<Made>& made);
  void finish();

 private:
  using Clock = std::chrono::steady_clock;
  void update(std::string_view task, double done, double total);
  void draw(double done, double total);
  double elapsed() const;
  /// At the rate since the task began here, so that a resumed task does not promise too much; < 0: unknown.
  double seconds_left(double done, double total) const;

  bool json_, quiet_, is_terminal_;
  std::string task_, stage_;
  Clock::time_point start_, last_drawn_;
  double first_done_ = 0, last_done_ = 0, last_total_ = 0;
  bool bar_drawn_ = false;
};

/// One event of --progress json on standard error. Bytes that are not UTF-8 are replaced.
void write_event(const nlohmann::json& event);

/// Installs a handler for Ctrl-C and termination: the first asks the running stage to stop and keep what it
/// has and says that it was heard, the second ends at once. And one for SIGBUS, which names the mapped file
/// that became shorter.
void install_signal_handlers();

/// One line of a terminal `columns` wide (0: not known): task, bar, share in [0,1], text. Without the bar,
/// and cut, where it would wrap.
std::string progress_line(const std::string& task, double share, const std::string& text, size_t columns);

/// "1 h 02 min", "3 min 20 s", "12 s".
std::string format_duration(double seconds);

}  // namespace patina::app
