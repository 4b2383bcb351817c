#include "failing_calls.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <mutex>

namespace patina::test {
namespace {

std::mutex g_mutex;
std::string g_folder;  // empty: nothing is watched
std::function<int(const FileCall&)> g_fails;

// The error that the call shall end with, 0: none.
int failure_of(const char* kind, const std::string& path) {
  const std::lock_guard lock(g_mutex);
  if (g_folder.empty() || !path.starts_with(g_folder)) return 0;
  const std::string folder = std::exchange(g_folder, "");  // what is decided about changes nothing itself
  const int error = g_fails({kind, path});
  g_folder = folder;
  return error;
}

std::string path_of(int fd) {
  char path[4096];
  const ssize_t n = ::readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof path);
  return n > 0 ? std::string(path, static_cast<size_t>(n)) : "";
}

bool fails(const char* kind, const std::string& path) {
  const int error = failure_of(kind, path);
  if (error) errno = error;
  return error != 0;
}

}  // namespace

FailingCalls::FailingCalls(const std::filesystem::path& folder, std::function<int(const FileCall&)> fails) {
  const std::lock_guard lock(g_mutex);
  g_folder = folder.string();
  g_fails = std::move(fails);
}

FailingCalls::~FailingCalls() {
  const std::lock_guard lock(g_mutex);
  g_folder.clear();
}

}  // namespace patina::test

// Programs call these before the library's of the same names.
extern "C" {

int open(const char* path, int flags, ...) {
  mode_t mode = 0;
  if (flags & (O_CREAT | O_TMPFILE)) {
    va_list rest;
    va_start(rest, flags);
    mode = va_arg(rest, mode_t);
    va_end(rest);
  }
  if ((flags & O_CREAT) && patina::test::fails("open", path)) return -1;
  return static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
}

ssize_t write(int fd, const void* bytes, size_t size) {
  if (patina::test::fails("write", patina::test::path_of(fd))) {
    const int error = errno;
    (void)!::syscall(SYS_write, fd, bytes, size / 2);
    errno = error;
    return -1;
  }
  return ::syscall(SYS_write, fd, bytes, size);
}

int fsync(int fd) {
  if (patina::test::fails("fsync", patina::test::path_of(fd))) return -1;
  return static_cast<int>(::syscall(SYS_fsync, fd));
}

int rename(const char* from, const char* to) {
  if (patina::test::fails("rename", to)) return -1;
  return static_cast<int>(::syscall(SYS_rename, from, to));
}

int mkdir(const char* path, mode_t mode) {
  if (patina::test::fails("mkdir", path)) return -1;
  return static_cast<int>(::syscall(SYS_mkdir, path, mode));
}
}
