// Shards: files that hold named payloads behind a JSON index, as the training data travel. Layout: the eight
// bytes "PMSHARD1", the index's length as a little-endian u64, the index, the payloads one after another.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <nlohmann/json.hpp>

namespace patina::mini_data {

/// `meta` says what the payload is: at least "kind" and "name".
struct Entry {
  nlohmann::json meta;
  std::vector<uint8_t> payload;
};

/// Written beside `path` and renamed. Throws Error{kIo}.
void write_shard(const std::filesystem::path& path, std::span<const Entry> entries);

/// Throws Error{kNotFound, kIo, kFormat} naming the file, what was expected and what was found.
std::vector<Entry> read_shard(const std::filesystem::path& path);

}  // namespace patina::mini_data
