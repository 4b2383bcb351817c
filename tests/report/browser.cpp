#include "browser.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <stdexcept>

namespace patina::test {
namespace {

using nlohmann::json;

constexpr int kSilenceMs = 120'000;

// Whether a message tells of something that went wrong in the page.
bool is_complaint(const json& message) {
  const std::string method = message.value("method", "");
  return method == "Runtime.exceptionThrown" || method == "Runtime.consoleAPICalled" ||
         method == "Log.entryAdded";
}

}  // namespace

Browser::Browser(const std::vector<std::string>& flags) {
  std::vector<std::string> arguments{kChromium,
                                     "--headless=new",
                                     "--no-sandbox",
                                     "--use-angle=swiftshader",
                                     "--enable-unsafe-swiftshader",
                                     "--disable-background-networking",
                                     "--hide-scrollbars",
                                     "--remote-debugging-pipe",
                                     "--user-data-dir=" + profile_.path().string()};
  arguments.insert(arguments.end(), flags.begin(), flags.end());
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);

  std::array<int, 2> to{}, from{};
  if (::pipe2(to.data(), O_CLOEXEC) != 0 || ::pipe2(from.data(), O_CLOEXEC) != 0)
    throw std::runtime_error("pipe failed");
  child_ = ::fork();
  if (child_ < 0) throw std::runtime_error("fork failed");
  if (child_ == 0) {
    ::setpgid(0, 0);
    const int nowhere = ::open("/dev/null", O_RDWR);
    ::dup2(nowhere, STDOUT_FILENO), ::dup2(nowhere, STDERR_FILENO);
    // Out of the way first: either may lie on 3 or 4 itself.
    const int in = ::fcntl(to[0], F_DUPFD, 10), out = ::fcntl(from[1], F_DUPFD, 10);
    ::dup2(in, 3), ::dup2(out, 4);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ::close(to[0]), ::close(from[1]);
  to_browser_ = to[1], from_browser_ = from[0];

  const json target = call("Target.createTarget", {{"url", "about:blank"}});
  session_ =
      call("Target.attachToTarget", {{"targetId", target.at("targetId")}, {"flatten", true}}).at("sessionId");
  for (const char* domain : {"Page.enable", "Runtime.enable", "Log.enable"}) call(domain, json::object());
}

Browser::~Browser() {
  ::close(to_browser_), ::close(from_browser_);
  ::kill(-child_, SIGKILL);  // the helpers that it started too
  ::waitpid(child_, nullptr, 0);
}

json Browser::next_message() {
  size_t end = buffer_.find('\0');
  while (end == std::string::npos) {
    pollfd source{from_browser_, POLLIN, 0};
    if (::poll(&source, 1, kSilenceMs) <= 0) throw std::runtime_error("the browser is silent");
    std::array<char, 65536> chunk;
    const ssize_t n = ::read(from_browser_, chunk.data(), chunk.size());
    if (n <= 0) throw std::runtime_error("the browser has ended");
    buffer_.append(chunk.data(), static_cast<size_t>(n));
    end = buffer_.find('\0');
  }
  const json message = json::parse(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(end));
  buffer_.erase(0, end + 1);
  return message;
}

json Browser::call(const std::string& method, const json& parameters) {
  json request{{"id", ++last_id_}, {"method", method}, {"params", parameters}};
  if (!session_.empty()) request["sessionId"] = session_;
  const std::string text = request.dump();
  for (size_t sent = 0; sent <= text.size();) {
    const ssize_t n = ::write(to_browser_, text.c_str() + sent, text.size() + 1 - sent);
    if (n <= 0) throw std::runtime_error("the browser does not listen");
    sent += static_cast<size_t>(n);
  }
  while (true) {
    const json message = next_message();
    if (is_complaint(message)) console_ += message.at("params").dump() + "\n";
    if (message.value("id", 0) != last_id_) continue;
    if (message.contains("error")) throw std::runtime_error(method + ": " + message.at("error").dump());
    return message.at("result");
  }
}

void Browser::set_size(int width, int height) {
  call("Emulation.setDeviceMetricsOverride",
       {{"width", width}, {"height", height}, {"deviceScaleFactor", 1}, {"mobile", false}});
}

void Browser::open(const std::filesystem::path& page) {
  call("Page.navigate", {{"url", "file://" + std::filesystem::absolute(page).string()}});
  run("if (document.readyState !== 'complete') await new Promise(done => addEventListener('load', done));");
}

json Browser::run(const std::string& body) {
  const json result = call(
      "Runtime.evaluate",
      {{"expression", "(async () => {" + body + "})()"}, {"awaitPromise", true}, {"returnByValue", true}});
  if (result.contains("exceptionDetails")) throw std::runtime_error(result.at("exceptionDetails").dump());
  return result.at("result").value("value", json());
}

}  // namespace patina::test
