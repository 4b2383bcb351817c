// The one table of the maps that a fit may change: what they are called, where they stand, how they are
// stored. A new map is a member of MaterialMaps and a MapSlot (material_maps.h), a row here, and a row in
// inverse/fit_slots.h.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "patina/asset/material_maps.h"

namespace patina::asset {

/// How a picture file holds a map.
enum class MapEncoding {
  kSrgb,    // [3] sRGB
  kLinear,  // [1] the values themselves
  kNormal,  // [3] ½ + ½ n
};

/// How a fitted map stores values. kRoot: √(value + 0.01), so that a step means about as much to the eye in
/// the dark as in the light, and black can still become lighter.
enum class StoredAs { kValue, kRoot };

struct MapSlotRow {
  MapSlot slot;
  const char* name;   // in options, file names and JSON
  const char* title;  // for people
  Map MaterialMaps::*map;
  int channels;
  MapEncoding encoding;
  float low, high;  // bounds of values, and of what a fit stores
  StoredAs stored;
};

/// In the order of MapSlot. GGX lobes of less roughness than 0.03 are narrower than float or views resolve; a
/// normal's components have no bounds, it is normalised.
inline constexpr std::array<MapSlotRow, kNumMapSlots> kMapSlots{{
    {MapSlot::kBaseColor, "base_color", "base colour", &MaterialMaps::base_color, 3, MapEncoding::kSrgb, 0.0f,
     1.0f, StoredAs::kRoot},
    {MapSlot::kRoughness, "roughness", "roughness", &MaterialMaps::roughness, 1, MapEncoding::kLinear, 0.03f,
     1.0f, StoredAs::kValue},
    {MapSlot::kMetallic, "metallic", "metallic", &MaterialMaps::metallic, 1, MapEncoding::kLinear, 0.0f, 1.0f,
     StoredAs::kValue},
    {MapSlot::kNormal, "normal", "normal", &MaterialMaps::normal, 3, MapEncoding::kNormal, -1e30f, 1e30f,
     StoredAs::kValue},
}};

constexpr const MapSlotRow& row_of(MapSlot slot) {
  return kMapSlots[index_of(slot)];
}
static_assert(std::all_of(kMapSlots.begin(), kMapSlots.end(),
                          [](const MapSlotRow& row) { return &row_of(row.slot) == &row; }));

inline Map& slot_map(MaterialMaps& maps, MapSlot slot) {
  return maps.*row_of(slot).map;
}
inline const Map& slot_map(const MaterialMaps& maps, MapSlot slot) {
  return maps.*row_of(slot).map;
}

/// The row of that name; nullopt if there is none.
std::optional<MapSlotRow> find_map_slot(std::string_view name);

/// Texels as a picture file holds them, and back; normals come back as unit vectors with z > 0.
Image picture_of(const Image& texels, MapEncoding encoding);
Image texels_of(const Image& picture, MapEncoding encoding);

/// Added to values before the root is taken.
inline constexpr float kRootOffset = 0.01f;
inline float stored_from_value(StoredAs stored_as, float value) {
  return stored_as == StoredAs::kRoot ? std::sqrt(std::max(value, 0.0f) + kRootOffset) : value;
}
inline float value_from_stored(StoredAs stored_as, float stored) {
  return stored_as == StoredAs::kRoot ? stored * stored - kRootOffset : stored;
}
inline float d_value_d_stored(StoredAs stored_as, float stored) {
  return stored_as == StoredAs::kRoot ? 2.0f * stored : 1.0f;
}

}  // namespace patina::asset
