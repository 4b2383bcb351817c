#include "patina/pipeline/blend.h"

#include <algorithm>

#include "patina/asset/map_slots.h"

namespace patina::pipeline {
namespace {

// Texels that are as they were stay so to the bit.
void mix(const asset::Map& before, float share, asset::MapEncoding encoding, Image& texels) {
  const Image old = asset::resized(before, texels.width, texels.height).texels;
  const auto channels = static_cast<size_t>(texels.channels);
  for (size_t i = 0; i < texels.pixels.size(); i += channels) {
    float* now = &texels.pixels[i];
    const float* was = &old.pixels[i];
    if (std::equal(was, was + channels, now)) continue;
    for (size_t c = 0; c < channels; ++c) now[c] = was[c] + share * (now[c] - was[c]);
    if (encoding != asset::MapEncoding::kNormal) continue;
    const vec3 unit = glm::normalize(vec3(now[0], now[1], now[2]));
    now[0] = unit.x, now[1] = unit.y, now[2] = unit.z;
  }
}

}  // namespace

FittedMaterials blended(const Workbench& bench, FittedMaterials fitted, float share) {
  if (share >= 1.0f) return fitted;
  if (share <= 0.0f) return {.maps = bench.maps, .changed = std::vector<asset::MapSet>(bench.maps.size())};
  for (size_t m = 0; m < fitted.maps.size(); ++m)
    for (const asset::MapSlotRow& row : asset::kMapSlots)
      if (has(fitted.changed[m], row.slot))
        mix(slot_map(bench.maps[m], row.slot), share, row.encoding,
            slot_map(fitted.maps[m], row.slot).texels);
  return fitted;
}

}  // namespace patina::pipeline
