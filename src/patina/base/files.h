// Files: whole reads with a limit, memory maps, writes that are either complete or not there, content hashes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace patina {

/// The whole file. Throws Error{kNotFound, kIo, kLimit} naming the file; folders and devices are refused.
std::vector<uint8_t> read_file(const std::filesystem::path& path, uint64_t max_bytes = uint64_t{1} << 32);
std::string read_text_file(const std::filesystem::path& path, uint64_t max_bytes = uint64_t{1} << 30);

/// A read-only memory map of a whole file; the pages live as long as the object.
class MappedFile {
 public:
  explicit MappedFile(const std::filesystem::path& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::span<const uint8_t> bytes() const { return bytes_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::span<const uint8_t> bytes_;
};

/// Writes beside `path` and renames: a reader, or a run that was killed, sees the old file or the whole new
/// one. Missing parent folders are made. Throws Error{kIo} naming the file and the reason.
void write_file(const std::filesystem::path& path, std::span<const uint8_t> bytes);
void write_file(const std::filesystem::path& path, std::string_view text);

/// The same for writers that want a path: `write` gets a temporary path beside `path` with the same
/// extension.
void write_file_with(const std::filesystem::path& path,
                     const std::function<void(const std::filesystem::path& temporary)>& write);

/// 128-bit XXH3 as 32 hexadecimal digits; for telling whether an input changed, not for security.
std::string hash_bytes(std::span<const uint8_t> bytes);
std::string hash_text(std::string_view text);
std::string hash_file(const std::filesystem::path& path);

}  // namespace patina
