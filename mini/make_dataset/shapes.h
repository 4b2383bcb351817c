// Procedural objects: things that people would want to age, made at random of a handful of building blocks.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mesh.h"

namespace patina::make_dataset {

struct Shape {
  std::vector<std::string> words;  // what it may be called, the most usual first
  Mesh mesh;
};

/// Names of the kinds that make_shape knows, in a fixed order.
const std::vector<std::string>& shape_kinds();

/// An object of a kind, its proportions drawn by `seed`. Throws Error{kUsage} for a kind that is not known.
Shape make_shape(const std::string& kind, uint64_t seed);

}  // namespace patina::make_dataset
