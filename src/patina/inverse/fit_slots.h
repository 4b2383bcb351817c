// How each map is fitted: its prior, when it joins, whether it follows kinds. One row a slot of
// asset/map_slots.h.
#pragma once

#include <array>
#include <cstddef>

#include "patina/asset/map_slots.h"
#include "patina/inverse/material_point.h"

namespace patina::inverse {

/// The prior on a fitted map. Each pyramid level holds detail of one size; `detail` is the cost of a texel's
/// squared coefficient at the finest level, in units of one fully weighted pixel's loss, and `coarser` times
/// that a level up, and so on: where the views say little, the smoother answer wins, while large areas move
/// freely. Coefficients far beyond `knee` cost only linearly, so that true edges stay sharp. `change` is the
/// cost of the squared change itself, less the one that the fit began with: it holds what the views leave
/// undecided.
struct Prior {
  float detail, coarser, knee, change;
};

struct FitSlot {
  asset::MapSlot slot;
  size_t first_value;  // of the slot's values among the floats of MapValues
  int unknowns;        // fitted channels: of a normal only how it tilts
  Prior prior;
  // Share of the iterations at which the map joins: while a colour is far too bright, a smoother or tilted
  // surface also darkens it, and roughness would run into a mirror from which no gradient leads back.
  float start;
  // Whether the change goes on over surface that no view saw. Tangent frames turn from place to place, so
  // what is smooth says nothing about normals there.
  bool fills_unseen;
  // Whether texels of one kind change alike (material_kinds.h).
  bool follows_kinds;
};

inline constexpr std::array<FitSlot, asset::kNumMapSlots> kFitSlots{{
    {asset::MapSlot::kBaseColor,
     offsetof(MapValues, base_color) / sizeof(float),
     3,
     {3.0f, 0.25f, 0.05f, 1e-3f},
     0.0f,
     true,
     false},
    {asset::MapSlot::kRoughness,
     offsetof(MapValues, roughness) / sizeof(float),
     1,
     {40.0f, 1.0f, 0.1f, 0.0f},
     0.05f,
     true,
     true},
    {asset::MapSlot::kMetallic,
     offsetof(MapValues, metallic) / sizeof(float),
     1,
     {20.0f, 1.0f, 0.1f, 0.1f},
     0.05f,
     true,
     true},
    {asset::MapSlot::kNormal,
     offsetof(MapValues, normal) / sizeof(float),
     2,
     {16.0f, 0.25f, 0.1f, 6.0f},
     0.15f,
     false,
     false},
}};

constexpr const FitSlot& fit_slot(asset::MapSlot slot) {
  return kFitSlots[asset::index_of(slot)];
}
static_assert(std::all_of(kFitSlots.begin(), kFitSlots.end(),
                          [](const FitSlot& row) { return &fit_slot(row.slot) == &row; }));

/// The slot's values in `values`, as many as the map has channels.
inline float* values_of(MapValues& values, asset::MapSlot slot) {
  return &values.base_color.x + fit_slot(slot).first_value;
}
inline const float* values_of(const MapValues& values, asset::MapSlot slot) {
  return &values.base_color.x + fit_slot(slot).first_value;
}
static_assert(sizeof(MapValues) == 8 * sizeof(float) && offsetof(MapValues, base_color) == 0);

}  // namespace patina::inverse
