#include "mini_data/shard.h"

#include <cstring>
#include <string>
#include <string_view>

#include "patina/base/error.h"
#include "patina/base/files.h"

namespace patina::mini_data {
namespace {

using Json = nlohmann::json;
constexpr std::string_view kMagic = "PMSHARD1";
constexpr size_t kHeaderBytes = 16;

[[noreturn]] void bad(const std::filesystem::path& path, const std::string& what) {
  throw Error(ErrorCode::kFormat, path.string(), what + "; make the shards anew with make_dataset pack");
}

}  // namespace

void write_shard(const std::filesystem::path& path, std::span<const Entry> entries) {
  Json index = Json::array();
  size_t payload_bytes = 0;
  for (const Entry& entry : entries) {
    Json item = entry.meta;
    item["bytes"] = entry.payload.size();
    index.push_back(std::move(item));
    payload_bytes += entry.payload.size();
  }
  const std::string text = index.dump();
  std::vector<uint8_t> out;
  out.reserve(kHeaderBytes + text.size() + payload_bytes);
  out.insert(out.end(), kMagic.begin(), kMagic.end());
  for (int i = 0; i < 8; ++i) out.push_back(static_cast<uint8_t>(uint64_t{text.size()} >> (8 * i)));
  out.insert(out.end(), text.begin(), text.end());
  for (const Entry& entry : entries) out.insert(out.end(), entry.payload.begin(), entry.payload.end());
  write_file(path, std::span<const uint8_t>(out));
}

std::vector<Entry> read_shard(const std::filesystem::path& path) {
  const std::vector<uint8_t> bytes = read_file(path);
  if (bytes.size() < kHeaderBytes || std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) != 0)
    bad(path, "expected a shard (its first bytes are PMSHARD1), found something else");
  uint64_t index_bytes = 0;
  for (size_t i = 0; i < 8; ++i) index_bytes |= uint64_t{bytes[8 + i]} << (8 * i);
  if (index_bytes > bytes.size() - kHeaderBytes)
    bad(path, "the index should be " + std::to_string(index_bytes) + " bytes long, but the file ends before");

  const auto begin = bytes.begin() + static_cast<ptrdiff_t>(kHeaderBytes);
  const auto end = begin + static_cast<ptrdiff_t>(index_bytes);
  const Json index = Json::parse(begin, end, nullptr, false);
  if (!index.is_array()) bad(path, "the index is no JSON array");
  std::vector<Entry> out;
  size_t at = kHeaderBytes + index_bytes;
  for (size_t i = 0; i < index.size(); ++i) {
    const Json& item = index[i];
    const auto has_text = [&](const char* key) { return item.contains(key) && item[key].is_string(); };
    if (!item.is_object() || !has_text("kind") || !has_text("name") || !item.contains("bytes") ||
        !item["bytes"].is_number_unsigned())
      bad(path, "entry " + std::to_string(i) + " of the index needs kind, name and bytes");
    const auto size = item["bytes"].get<uint64_t>();
    if (size > bytes.size() - at)
      bad(path, "the payload of " + item["name"].get<std::string>() + " should be " + std::to_string(size) +
                    " bytes long, but " + std::to_string(bytes.size() - at) + " are left");
    out.push_back(
        {item,
         {bytes.begin() + static_cast<ptrdiff_t>(at), bytes.begin() + static_cast<ptrdiff_t>(at + size)}});
    at += size;
  }
  if (at != bytes.size()) bad(path, "bytes are left after the last payload");
  return out;
}

}  // namespace patina::mini_data
