// What each kind of material has become, asked before the first step. A metal that is covered with moss lies
// across a hill from what it shall become: halfway a metal, it explains the views worse than either, and no
// step gets over that. But for given roughness and metallic, what a surface reflects is linear in its base
// colour, so each texel's best colour is known in closed form, and what is left over tells how well the views
// agree on it: metal looks different from everywhere, moss does not.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "patina/inverse/light_cache.h"
#include "patina/inverse/sample_taps.h"
#include "patina/render/bsdf.h"

namespace patina::inverse {

/// What is added to a kind's values.
struct KindChange {
  float roughness = 0, metallic = 0;
};

/// For each kind that was a metal and is none any more, how its values change; none for the others. (What an
/// edit makes shiny is no metal yet: models paint highlights on plastic too.)
/// `cache`: with the light and the calibration of the starting maps. `taps`: of a map of the material.
/// `kinds` [taps.samples], each below `num_kinds`. `gain` = 2^exposure_ev.
std::vector<std::optional<KindChange>> guess_changes(const LightCache& cache, render::BsdfModel model,
                                                     float gain, const SampleTaps& taps,
                                                     std::span<const uint16_t> kinds, size_t num_kinds);

}  // namespace patina::inverse
