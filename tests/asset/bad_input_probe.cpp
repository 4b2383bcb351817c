// Reads one file a line of standard input ("kind<TAB>path") with the library, each in a process of its own
// under limits of time and memory, and prints what became of it: path, outcome, seconds, peak MiB, message,
// separated by tabs. Outcomes: ok, error (patina::Error), other (any other exception), crash, timeout,
// printed (the library wrote to the terminal).
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <string>

#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/base/error.h"
#include "patina/image/image_io.h"

namespace {

constexpr unsigned kMaxSeconds = 10;
constexpr rlim_t kMaxAddressSpace = rlim_t{6} << 30;  // a net under the check of resident memory

void read_as(const std::string& kind, const std::filesystem::path& path) {
  if (kind == "png" || kind == "jpeg") {
    patina::read_image(path);
  } else if (kind == "hdr" || kind == "exr") {
    patina::read_hdr(path);
  } else {
    const patina::asset::Asset asset = patina::asset::read_asset(path);
    patina::asset::require_enhanceable(asset);
    patina::asset::resolve_materials(asset);
  }
}

// In the child: what happened goes to `message_fd`, anything the library prints to `terminal_fd`.
[[noreturn]] void run_child(const std::string& kind, const std::string& path, int message_fd,
                            int terminal_fd) {
  const rlimit memory{kMaxAddressSpace, kMaxAddressSpace}, no_core{0, 0};
#ifndef __SANITIZE_ADDRESS__  // which reserves far more address space than it uses
  ::setrlimit(RLIMIT_AS, &memory);
#else
  (void)memory;
#endif
  ::setrlimit(RLIMIT_CORE, &no_core);
  ::dup2(terminal_fd, STDOUT_FILENO);
  ::dup2(terminal_fd, STDERR_FILENO);
  ::alarm(kMaxSeconds);
  int code = 0;
  std::string message;
  try {
    read_as(kind, path);
  } catch (const patina::Error& e) {
    code = 1, message = e.what();
  } catch (const std::exception& e) {
    code = 2, message = e.what();
  }
  if (::write(message_fd, message.data(), message.size()) < 0) code = 3;
  std::fflush(nullptr);
  ::_exit(code);
}

std::string drained(int fd) {
  ::lseek(fd, 0, SEEK_SET);
  std::string text(4096, '\0');
  const ssize_t n = ::read(fd, text.data(), text.size());
  text.resize(n > 0 ? static_cast<size_t>(n) : 0);
  if (::ftruncate(fd, 0) != 0) text += " (the scratch file cannot be emptied)";
  ::lseek(fd, 0, SEEK_SET);
  return text;
}

}  // namespace

int main() {
  std::FILE* message_file = std::tmpfile();
  std::FILE* terminal_file = std::tmpfile();
  if (!message_file || !terminal_file) return 1;
  const int message_fd = ::fileno(message_file), terminal_fd = ::fileno(terminal_file);
  for (std::string line; std::getline(std::cin, line);) {
    const size_t tab = line.find('\t');
    const std::string kind = line.substr(0, tab), path = line.substr(tab + 1);
    const auto begin = std::chrono::steady_clock::now();
    const pid_t child = ::fork();
    if (child == 0) run_child(kind, path, message_fd, terminal_fd);
    int status = 0;
    rusage usage{};
    if (child < 0 || ::wait4(child, &status, 0, &usage) != child) return 1;
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    std::string message = drained(message_fd);
    const std::string printed = drained(terminal_fd);
    std::string outcome = "crash";
    if (WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM) outcome = "timeout";
    if (WIFEXITED(status))
      outcome = WEXITSTATUS(status) == 0 ? "ok" : WEXITSTATUS(status) == 1 ? "error" : "other";
    if (WIFEXITED(status) && !printed.empty()) outcome = "printed", message = printed;
    for (char& c : message)
      if (c == '\n' || c == '\t') c = '~';  // shows up as a fault: messages are one line
    std::printf("%s\t%s\t%.2f\t%ld\t%s\n", path.c_str(), outcome.c_str(), seconds, usage.ru_maxrss / 1024,
                message.c_str());
    std::fflush(stdout);
  }
  return 0;
}
