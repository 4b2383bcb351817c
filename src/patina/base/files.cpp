#include "patina/base/files.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/half_written.h"
#include "patina/base/mapped_files.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void throw_errno(const fs::path& path, std::string_view doing) {
  const int code = errno;
  const bool missing = code == ENOENT || code == ENOTDIR;
  throw Error(
      missing ? ErrorCode::kNotFound : ErrorCode::kIo, path.string(),
      missing ? std::string("no such file or folder") : fmt::format("{}: {}", doing, std::strerror(code)));
}

// A failed write of `bytes` to `path`.
Error cannot_write(const fs::path& path, int code, uint64_t bytes) {
  const bool is_full = code == ENOSPC || code == EDQUOT;
  return Error(ErrorCode::kIo, path.string(),
               fmt::format("cannot be written: {}{}", std::strerror(code),
                           is_full ? fmt::format("; the file needs {} bytes", bytes) : std::string()));
}

// An open file descriptor that closes itself.
struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};

// Opens a regular file; anything else (folder, device, pipe) could block or never end.
Descriptor open_regular(const fs::path& path, uint64_t& size_bytes) {
  struct stat info;
  if (::stat(path.c_str(), &info) != 0) throw_errno(path, "cannot be opened");
  if (!S_ISREG(info.st_mode))
    throw Error(ErrorCode::kFormat, path.string(),
                S_ISDIR(info.st_mode) ? "is a folder, expected a file" : "is not a regular file");
  Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.fd < 0) throw_errno(path, "cannot be opened");
  size_bytes = static_cast<uint64_t>(info.st_size);
  return file;
}

template <class Buffer>
Buffer read_whole(const fs::path& path, uint64_t max_bytes) {
  uint64_t size = 0;
  const Descriptor file = open_regular(path, size);
  if (size > max_bytes)
    throw Error(ErrorCode::kLimit, path.string(),
                fmt::format("has {} bytes, more than the {} that are accepted", size, max_bytes));
  Buffer buffer(size, {});
  size_t done = 0;
  while (done < buffer.size()) {
    const ssize_t n = ::read(file.fd, buffer.data() + done, buffer.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw_errno(path, "cannot be read");
    if (n == 0) throw Error(ErrorCode::kIo, path.string(), "became shorter while it was read");
    done += static_cast<size_t>(n);
  }
  return buffer;
}

// The maps that are there, for a signal handler: begin is written last and cleared first.
struct MapSlot {
  std::atomic<const uint8_t*> begin{nullptr};
  std::atomic<const uint8_t*> end{nullptr};
  std::atomic<const char*> name{nullptr};
};
std::array<MapSlot, 256> g_maps;  // files beyond these go unnamed

void add_map(std::span<const uint8_t> bytes, const char* name) {
  for (MapSlot& slot : g_maps) {
    const char* is_free = nullptr;
    if (!slot.name.compare_exchange_strong(is_free, name)) continue;
    slot.end = bytes.data() + bytes.size();
    slot.begin = bytes.data();
    return;
  }
}

void remove_map(const uint8_t* begin) {
  for (MapSlot& slot : g_maps)
    if (slot.begin == begin) {
      slot.begin = nullptr;
      slot.name = nullptr;
      return;
    }
}

std::string hex(XXH128_hash_t hash) {
  return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

}  // namespace

std::vector<uint8_t> read_file(const fs::path& path, uint64_t max_bytes) {
  return read_whole<std::vector<uint8_t>>(path, max_bytes);
}
std::string read_text_file(const fs::path& path, uint64_t max_bytes) {
  return read_whole<std::string>(path, max_bytes);
}

MappedFile::MappedFile(const fs::path& path) : path_(path) {
  uint64_t size = 0;
  const Descriptor file = open_regular(path, size);
  if (size == 0) return;  // mmap refuses empty files; an empty span says the same
  void* data = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.fd, 0);
  if (data == MAP_FAILED) throw_errno(path, "cannot be mapped");
  bytes_ = {static_cast<const uint8_t*>(data), size};
  add_map(bytes_, path_.c_str());
}

MappedFile::~MappedFile() {
  if (bytes_.empty()) return;
  remove_map(bytes_.data());
  ::munmap(const_cast<uint8_t*>(bytes_.data()), bytes_.size());
}

const char* mapped_file_at(const void* address) {
  for (const MapSlot& slot : g_maps)
    if (const uint8_t* begin = slot.begin; begin && begin <= address && address < slot.end.load())
      return slot.name;
  return nullptr;
}

namespace {

// A hidden name beside `path`, of this process, with the same extension.
fs::path temporary_beside(const fs::path& path) {
  return path.parent_path() /
         fmt::format(".{}.{}{}", path.stem().string(), ::getpid(), path.extension().string());
}

bool is_temporary(const fs::path& path) {
  const std::string name = path.filename().string();
  // ".stem.1234.extension", or ".stem.1234" where the file has none.
  const std::string number = path.stem().extension().string();
  const auto is_number = [](const std::string& text) {
    return text.size() > 1 &&
           std::all_of(text.begin() + 1, text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
  };
  return name.starts_with('.') && (is_number(number) || is_number(path.extension().string()));
}

}  // namespace

void remove_half_written(const fs::path& folder) {
  std::error_code failure;
  std::vector<fs::path> found;
  for (auto at = fs::recursive_directory_iterator(folder, failure);
       !failure && at != fs::recursive_directory_iterator(); at.increment(failure))
    if (at->is_regular_file(failure) && is_temporary(at->path())) found.push_back(at->path());
  for (const fs::path& path : found) fs::remove(path, failure);
}

void write_file_with(const fs::path& path, const std::function<void(const fs::path&)>& write) {
  std::error_code failure;
  if (path.has_parent_path()) {
    fs::create_directories(path.parent_path(), failure);
    if (failure)
      throw Error(ErrorCode::kIo, path.parent_path().string(), "cannot be made: " + failure.message());
  }
  const fs::path temporary = temporary_beside(path);
  try {
    write(temporary);
    fs::rename(temporary, path);
  } catch (const fs::filesystem_error& e) {
    fs::remove(temporary, failure);
    throw Error(ErrorCode::kIo, path.string(), "cannot be written: " + e.code().message());
  } catch (...) {
    fs::remove(temporary, failure);
    throw;
  }
}

void write_file(const fs::path& path, std::span<const uint8_t> bytes) {
  write_file_with(path, [&](const fs::path& temporary) {
    const Descriptor file{::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)};
    if (file.fd < 0) throw cannot_write(path, errno, bytes.size());
    size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t n = ::write(file.fd, bytes.data() + done, bytes.size() - done);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) throw cannot_write(path, errno, bytes.size());
      done += static_cast<size_t>(n);
    }
    if (::fsync(file.fd) != 0 && errno != EINVAL && errno != EROFS)
      throw cannot_write(path, errno, bytes.size());
  });
}

void write_file(const fs::path& path, std::string_view text) {
  write_file(path, std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
}

std::string hash_bytes(std::span<const uint8_t> bytes) {
  return hex(XXH3_128bits(bytes.data(), bytes.size()));
}
std::string hash_text(std::string_view text) {
  return hex(XXH3_128bits(text.data(), text.size()));
}
std::string hash_file(const fs::path& path) {
  return hash_bytes(MappedFile(path).bytes());
}

}  // namespace patina
