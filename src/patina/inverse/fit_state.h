// What a fit changes from iteration to iteration, how maps follow from it, and its bytes in a checkpoint.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "patina/inverse/evidence.h"
#include "patina/inverse/fit_options.h"
#include "patina/inverse/texture_field.h"

namespace patina::inverse {

/// One fitted map of one material.
struct FittedMap {
  int material = 0;
  asset::MapSlot slot = asset::MapSlot::kBaseColor;
  TextureField field;
  float texels_per_pixel = 0;  // of the map at its full size
  Image evidence;              // [h,w,1] at the field's size: weight with which views saw the texel
  Image may_change;  // [h,w,1] 1: seen, beside a seen texel, or used by no surface (padding); 0: surface that
                     // no view saw
};

/// `base` with every fitted map's change added, clamped, normals renormalised. Texels that must not change
/// keep base's exact value. kIslands: the change goes on beyond the texels that the views saw, so that no mip
/// level shows a seam; not needed between iterations.
enum class Padding { kNone, kIslands };
std::vector<asset::MaterialMaps> apply_changes(const std::vector<asset::MaterialMaps>& base,
                                               std::span<const FittedMap> fitted, Padding padding);

/// `base` with every fitted map at the size of its field: about a texel a pixel, enough for the light that
/// surfaces throw on each other.
std::vector<asset::MaterialMaps> shrunk(const std::vector<asset::MaterialMaps>& base,
                                        std::span<const FittedMap> fitted);

/// Parameters only: [map][level].
using Parameters = std::vector<std::vector<Image>>;
Parameters parameters_of(std::span<const FittedMap> fitted);
void set_parameters(std::vector<FittedMap>& fitted, const Parameters& parameters);
Parameters sum_of(Parameters a, const Parameters& b);

/// Everything that the next iteration depends on.
struct FitState {
  int next_iteration = 0;
  float damping = 0.01f;  // Marquardt's, of the next step
  std::vector<FittedMap> fitted;
  Parameters light_parameters;       // with which the light was traced last
  std::vector<Image> displacements;  // of each edited view (alignment.h)
  std::vector<float> loss;           // per iteration
};

FitCheckpoint make_checkpoint(const FitState& state);
/// Overwrites `state`, which must have been set up the same way. Throws Error{kFormat} if the bytes belong to
/// another set-up.
void restore_checkpoint(FitState& state, const FitCheckpoint& checkpoint);

}  // namespace patina::inverse
