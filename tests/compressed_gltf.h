// Writes compressed glTF with the encoders of the libraries that read it, from an uncompressed file whose
// buffer views hold one accessor each, tightly packed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace patina::test {

/// A GLB taken apart. Its bytes are buffer 0.
struct GlbParts {
  nlohmann::ordered_json json;
  std::vector<uint8_t> bin;

  /// Appends a buffer view of these bytes; returns its index.
  size_t add_view(const std::vector<uint8_t>& bytes);
  std::vector<uint8_t> view_bytes(size_t index) const;
};
GlbParts read_glb_parts(const std::filesystem::path& path);
std::vector<uint8_t> glb_of(GlbParts parts);

/// Every view of an accessor becomes one of EXT_meshopt_compression (or `extension`), without loss: triangles
/// as TRIANGLES, all else as ATTRIBUTES. Its own bytes lie in a second buffer that has none.
GlbParts with_meshopt(const GlbParts& plain, const char* extension = "EXT_meshopt_compression");

/// Compressed bytes of elements under a filter: unit vectors (x, y, z, 0), quaternions (x, y, z, w) or
/// numbers; `stride` bytes of each come out. And of indices as a sequence.
std::vector<uint8_t> meshopt_filtered(const std::string& filter, const std::vector<float>& values,
                                      size_t count, size_t stride, int bits);
std::vector<uint8_t> meshopt_sequence(const std::vector<uint32_t>& indices);

/// Bits of Draco's quantisation; 0 for none, which keeps the numbers as they are.
struct DracoBits {
  int position = 14, normal = 10, uv = 12;
};

/// Every primitive becomes one of KHR_draco_mesh_compression: by edgebreaker, which reorders vertices and
/// triangles, or `in_order`. Accessors lose their views.
GlbParts with_draco(const GlbParts& plain, bool in_order, const DracoBits& bits = {});

}  // namespace patina::test
