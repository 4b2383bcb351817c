// How long jobs tell the outside what they do. The library only calls these functions; the command line draws
// bars with time left, a test records, a benchmark ignores.
#pragma once

#include <functional>
#include <string_view>

namespace patina {

struct Progress {
  /// `done` of `total` units of `task` are finished; called from one thread at a time, total > 0.
  std::function<void(std::string_view task, double done, double total)> on_update;
  /// Something the user should know that is no failure: what was assumed, left out or degraded.
  std::function<void(std::string_view text)> on_warning;
  /// True once the user asked to stop; long jobs ask between units and then throw Error{kInterrupted}.
  std::function<bool()> stop_requested;

  void update(std::string_view task, double done, double total) const {
    if (on_update) on_update(task, done, total);
  }
  void warn(std::string_view text) const {
    if (on_warning) on_warning(text);
  }
  /// Throws Error{kInterrupted} once a stop was requested.
  void throw_if_stopped() const;
};

}  // namespace patina
