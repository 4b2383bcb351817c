#include "patina/base/memory.h"

#include <fstream>
#include <string>

namespace patina {
namespace {

/// The value of "name:   123 kB" in a file of /proc.
int64_t bytes_in(const char* file, const std::string& name) {
  std::ifstream lines(file);
  for (std::string word; lines >> word;) {
    int64_t kilobytes = 0;
    if (word == name && lines >> kilobytes) return kilobytes * 1024;
  }
  return 0;
}

}  // namespace

int64_t resident_bytes() {
  return bytes_in("/proc/self/status", "VmRSS:");
}
int64_t peak_resident_bytes() {
  return bytes_in("/proc/self/status", "VmHWM:");
}
int64_t available_bytes() {
  return bytes_in("/proc/meminfo", "MemAvailable:");
}
int64_t total_bytes() {
  return bytes_in("/proc/meminfo", "MemTotal:");
}

}  // namespace patina
