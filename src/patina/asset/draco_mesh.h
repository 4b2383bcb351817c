// KHR_draco_mesh_compression: vertices and triangles of one mesh primitive, which the Draco library
// decompresses.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "patina/asset/accessor.h"

namespace patina::asset {

/// One attribute of all vertices, in the order of its components, as the accessor describes them.
struct DracoAttribute {
  Component component = Component::kFloat;
  int num_components = 1;
  std::vector<uint8_t> bytes;  // tightly packed
};

struct DracoMesh {
  size_t num_vertices = 0;
  std::vector<uint32_t> corners;                     // three a triangle; each names a vertex
  std::map<std::string, DracoAttribute> attributes;  // by their names in glTF: POSITION and so on
};

/// The mesh of a primitive that carries the extension; nothing for others. At most `max_vertices` vertices
/// and triangles. Throws Error{kFormat, kUnsupported, kLimit} that names the primitive, before the library
/// takes memory for what the data claims.
std::optional<DracoMesh> read_draco_mesh(const SourceDocument& document, const JsonView& primitive,
                                         uint64_t max_vertices);

}  // namespace patina::asset
