#include "pack.h"

#include <algorithm>
#include <vector>

#include "mini_data/shard.h"
#include "patina/base/error.h"
#include "patina/base/files.h"

namespace patina::make_dataset {
namespace {

namespace fs = std::filesystem;
using mini_data::Entry;

constexpr size_t kShardBytes = size_t{12} << 20;  // a shard ends with the object that passes this

fs::path numbered(const fs::path& folder, int number) {
  const std::string digits = std::to_string(100 + number).substr(1);
  return folder / ("objects_" + digits + ".shard");
}

}  // namespace

std::string pack(const fs::path& work, const fs::path& shards) {
  std::vector<fs::path> objects;
  if (fs::is_directory(work / "objects"))
    for (const auto& item : fs::directory_iterator(work / "objects"))
      if (item.path().extension() == ".shard") objects.push_back(item.path());
  if (objects.empty())
    throw Error(ErrorCode::kNotFound, (work / "objects").string(),
                "holds no baked objects; run make_dataset objects");
  std::sort(objects.begin(), objects.end());

  // Shards of an earlier, larger set must not stay among the new ones.
  fs::create_directories(shards);
  for (const auto& item : fs::directory_iterator(shards))
    if (item.path().extension() == ".shard") fs::remove(item.path());

  const std::vector<Entry> materials = mini_data::read_shard(work / "materials.shard");
  mini_data::write_shard(shards / "materials.shard", materials);
  nlohmann::json credits = nlohmann::json::array();
  size_t bytes = 0, num_views = 0;
  for (const Entry& entry : materials) {
    nlohmann::json credit = entry.meta.at("credit");
    credit["name"] = entry.meta.at("name");
    credit["class"] = entry.meta.at("class");
    credit["held_out"] = entry.meta.at("held_out");
    credits.push_back(credit);
    bytes += entry.payload.size();
  }
  write_file(shards / "credits.json", credits.dump(1) + "\n");

  std::vector<Entry> gathered;
  size_t gathered_bytes = 0;
  int number = 0;
  for (size_t i = 0; i < objects.size(); ++i) {
    for (Entry& entry : mini_data::read_shard(objects[i])) {
      gathered_bytes += entry.payload.size();
      num_views += entry.meta.at("kind") == "view";
      gathered.push_back(std::move(entry));
    }
    if (gathered_bytes >= kShardBytes || i + 1 == objects.size()) {
      mini_data::write_shard(numbered(shards, number++), gathered);
      bytes += gathered_bytes;
      gathered.clear();
      gathered_bytes = 0;
    }
  }
  return std::to_string(materials.size()) + " materials, " + std::to_string(objects.size()) + " objects, " +
         std::to_string(num_views) + " views, " + std::to_string(bytes >> 10) + " KiB\n";
}

}  // namespace patina::make_dataset
