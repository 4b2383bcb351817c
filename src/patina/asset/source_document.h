// The bytes an asset came from. Readers take their data out of it, export carries what it does not change
// over from it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/asset/asset.h"
#include "patina/asset/json_view.h"
#include "patina/asset/uv_tiles.h"

namespace patina::asset {

/// One glTF buffer. `bytes` has byteLength bytes, or none where only an unsupported extension could fill it.
struct SourceBuffer {
  std::vector<uint8_t> owned;  // of a file or data URI; the GLB's own chunk needs no copy
  std::span<const uint8_t> bytes;
  std::string reference;  // decoded relative path of an external file, else empty
};

struct SourceDocument {
  enum class Kind { kGlb, kGltf, kObj };

  Kind kind = Kind::kGltf;
  std::filesystem::path path;
  std::string name;           // path as text, the context of every error
  std::vector<uint8_t> file;  // all of it

  // glTF and GLB
  size_t json_begin = 0, json_end = 0;  // range of the JSON text in `file`, without the GLB's padding
  size_t bin_begin = 0, bin_end = 0;    // range of the GLB's BIN chunk data; empty where there is none
  nlohmann::json json;
  std::vector<SourceBuffer> buffers;
  std::vector<std::span<const uint8_t>> views;  // bufferViews, checked against their buffers; decompressed
  std::vector<std::vector<uint8_t>> decompressed_views;  // what those of compressed views point to

  std::vector<std::string>
      references;  // decoded relative paths of all other files that the asset names, found or not

  std::vector<std::string> image_files;      // one an image of the asset: its relative path, or ""
  std::vector<TiledTexture> tiled_textures;  // those that a file name with a token told, of materials in use

  // OBJ
  std::string converted;                    // the text as UTF-8 where the file is UTF-16
  std::vector<std::string> mtl_references;  // relative paths of the material libraries that were found
  std::vector<std::string> material_names;  // one a material, as the file spells it; "" for faces without one

  std::filesystem::path folder() const { return path.parent_path(); }
  std::string_view json_text() const {
    return std::string_view(reinterpret_cast<const char*>(file.data()), file.size())
        .substr(json_begin, json_end - json_begin);
  }
  std::string_view obj_text() const {
    return converted.empty() ? std::string_view(reinterpret_cast<const char*>(file.data()), file.size())
                             : std::string_view(converted);
  }
  JsonView root() const { return JsonView(json, name); }
};

/// What a small file may grow to in memory: flattened vertices (and triangles) of the whole asset, bytes of
/// decoded images, and bytes of decompressed buffer views or of one decompressed primitive. All start
/// generous and grow with the file, so that a few bytes of instancing, zero-filled accessors or compressed
/// data cannot exhaust memory.
struct MemoryBudget {
  uint64_t vertices;
  uint64_t image_bytes;
  uint64_t decompressed_bytes;
};
MemoryBudget memory_budget(uint64_t source_bytes);

/// Bytes of all that was read for the document (file and external buffers).
uint64_t source_bytes(const SourceDocument& document);

}  // namespace patina::asset
