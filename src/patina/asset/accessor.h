// glTF accessors: every component type, strides, normalisation and sparse substitution, read into floats or
// integers after all sizes are checked [glTF2, Sec. 3.6.2].
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "patina/asset/source_document.h"
#include "patina/base/math.h"

namespace patina::asset {

/// Component types by their numbers in the file.
enum class Component {
  kInt8 = 5120,
  kUint8 = 5121,
  kInt16 = 5122,
  kUint16 = 5123,
  kUint32 = 5125,
  kFloat = 5126
};

size_t component_bytes(Component component);

/// What the description of an accessor says, without its data.
struct AccessorInfo {
  JsonView json;
  Component component = Component::kFloat;
  int num_components = 1;  // 1 to 4, or 16 for MAT4
  bool normalized = false;
  size_t count = 0;
  std::span<const uint8_t> decompressed = {};  // packed elements that stand for the accessor's own data
};

/// `reference` is the JSON value that holds the accessor's index. `max_count` guards accessors that take no
/// bytes of the file.
AccessorInfo accessor_info(const SourceDocument& document, const JsonView& reference, uint64_t max_count);

/// All elements, num_components floats each; normalised integers mapped to [0,1] or [-1,1], others converted.
std::vector<float> read_floats(const SourceDocument& document, const AccessorInfo& info);

/// All elements of an accessor with integer components.
std::vector<uint32_t> read_integers(const SourceDocument& document, const AccessorInfo& info);

}  // namespace patina::asset
