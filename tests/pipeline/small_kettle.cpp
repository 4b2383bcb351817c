#include "small_kettle.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/asset/export.h"
#include "patina/asset/material_maps.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "support.h"

namespace patina::test {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr int kNarrower = 32;
constexpr size_t kJsonAt = 20, kBinHeader = 8;  // a GLB's offsets [glTF2, Sec. 4.4]

std::vector<uint8_t> shrunk(std::span<const uint8_t> png, const std::string& name) {
  const asset::Map map{.texels = decode_image(png, name)};
  return encode_png(asset::resized(map, std::max(1, map.texels.width / kNarrower),
                                   std::max(1, map.texels.height / kNarrower))
                        .texels);
}

// The pictures themselves are exchanged: an export keeps the size of one whose channels it does not own.
void write_small_kettle(const fs::path& path) {
  const std::vector<uint8_t> glb =
      read_file(data_dir().parent_path().parent_path() / "examples" / "kettle.glb");
  uint32_t json_bytes = 0;
  std::memcpy(&json_bytes, glb.data() + 12, sizeof json_bytes);
  json gltf = json::parse(glb.begin() + kJsonAt, glb.begin() + kJsonAt + json_bytes);
  const std::span<const uint8_t> bin = std::span(glb).subspan(kJsonAt + json_bytes + kBinHeader);

  std::vector<std::vector<uint8_t>> parts;  // one a buffer view
  for (const json& view : gltf["bufferViews"]) {
    const auto part = bin.subspan(view.value("byteOffset", size_t{0}), view["byteLength"].get<size_t>());
    parts.emplace_back(part.begin(), part.end());
  }
  for (const json& image : gltf["images"]) {
    std::vector<uint8_t>& part = parts[image["bufferView"].get<size_t>()];
    part = shrunk(part, image["name"].get<std::string>());
  }
  std::vector<uint8_t> joined;
  for (size_t i = 0; i < parts.size(); ++i) {
    gltf["bufferViews"][i]["byteOffset"] = joined.size();
    gltf["bufferViews"][i]["byteLength"] = parts[i].size();
    joined.insert(joined.end(), parts[i].begin(), parts[i].end());
    joined.resize((joined.size() + 3) / 4 * 4);  // accessors begin at multiples of four
  }
  gltf["buffers"][0]["byteLength"] = joined.size();
  write_file(path, asset::glb_bytes(gltf.dump(), joined, path.string()));
}

}  // namespace

std::filesystem::path small_kettle() {
  static const TemporaryFolder folder;
  static const fs::path made = [] {
    write_small_kettle(folder.path() / "kettle.glb");
    return folder.path() / "kettle.glb";
  }();
  return made;
}

}  // namespace patina::test
