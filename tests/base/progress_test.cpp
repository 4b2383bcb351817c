#include "patina/base/progress.h"

#include <string>

#include <gtest/gtest.h>

#include "patina/base/error.h"

namespace patina {
namespace {

TEST(Progress, without_listeners_is_silent) {
  const Progress progress;
  progress.update("render", 1, 2);
  progress.warn("nothing");
  EXPECT_NO_THROW(progress.throw_if_stopped());
}

TEST(Progress, passes_on_updates_and_warnings) {
  Progress progress;
  std::string log;
  progress.on_update = [&](std::string_view task, double done, double total) {
    log += std::string(task) + " " + std::to_string(static_cast<int>(100 * done / total)) + ";";
  };
  progress.on_warning = [&](std::string_view text) { log += "! " + std::string(text); };
  progress.update("fit", 1, 4);
  progress.warn("no UVs");
  EXPECT_EQ(log, "fit 25;! no UVs");
}

TEST(Progress, throws_interrupted_once_a_stop_was_asked) {
  Progress progress;
  bool stop = false;
  progress.stop_requested = [&] { return stop; };
  EXPECT_NO_THROW(progress.throw_if_stopped());
  stop = true;
  try {
    progress.throw_if_stopped();
    FAIL() << "did not throw";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kInterrupted);
  }
}

}  // namespace
}  // namespace patina
