// Environments to light the objects with: the product's studio, skies, random soft boxes, photographed maps.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "patina/render/environment.h"

namespace patina::make_dataset {

struct Light {
  std::string name;
  bool held_out = false;
  render::Environment environment;
};

/// An environment of the kind that `index` chooses, turned and varied by `seed`. `hdri` is the folder of
/// photographed maps, or empty; one of them and one kind of boxes are kept for testing.
Light make_light(uint64_t seed, const std::filesystem::path& hdri, bool held_out);

}  // namespace patina::make_dataset
