// A page in a real browser: headless Chromium without network, WebGL in software, driven through its
// debugging pipe (the Chrome DevTools Protocol: JSON messages, each ended by a zero byte, on descriptors 3
// and 4).
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "../support.h"

namespace patina::test {

inline constexpr const char* kChromium = "/usr/bin/chromium";

/// Skips the running test where there is no browser.
#define PATINA_REQUIRE_CHROMIUM()                          \
  if (!std::filesystem::exists(::patina::test::kChromium)) \
  GTEST_SKIP() << "needs " << ::patina::test::kChromium << "; scripts/setup.sh --ci installs it"

/// One window. Every function throws std::runtime_error where the browser fails, or is silent for two
/// minutes.
class Browser {
 public:
  explicit Browser(const std::vector<std::string>& flags = {});
  ~Browser();
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  void set_size(int width, int height);
  /// Opens a file and waits until it is loaded.
  void open(const std::filesystem::path& page);
  /// Runs the body of an async function in the page and returns what it returns.
  nlohmann::json run(const std::string& body);
  /// What the page has thrown, or written to the console, so far; one message a line.
  const std::string& console() const { return console_; }

 private:
  nlohmann::json call(const std::string& method, const nlohmann::json& parameters);
  nlohmann::json next_message();

  TemporaryFolder profile_;
  pid_t child_ = -1;
  int to_browser_ = -1, from_browser_ = -1;
  int last_id_ = 0;
  std::string session_, buffer_, console_;
};

}  // namespace patina::test
