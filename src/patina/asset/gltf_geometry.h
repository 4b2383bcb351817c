// glTF mesh primitives: attributes, indices, morph targets and skins, as triangles [glTF2, Sec. 3.7].
#pragma once

#include <optional>
#include <span>

#include "patina/asset/geometry.h"
#include "patina/asset/source_document.h"

namespace patina::asset {

/// A primitive in its mesh's space.
struct LocalPrimitive {
  Geometry geometry;
  std::vector<glm::uvec4> joints;  // up to four joints a vertex; empty for most
  std::vector<vec4> weights;
  int material = -1;  // -1: the default material
};

/// Reads a mesh's primitive with `weights` of its morph targets applied (empty: none). Nothing for points and
/// lines. Normals are made where there are none; tangents are not. At most `max_vertices` vertices and
/// triangles are read.
std::optional<LocalPrimitive> read_primitive(const SourceDocument& document, const JsonView& primitive,
                                             std::span<const float> weights, uint64_t max_vertices,
                                             std::vector<std::string>& warnings);

}  // namespace patina::asset
