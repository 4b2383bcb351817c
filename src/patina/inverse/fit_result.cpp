#include "patina/inverse/fit_result.h"

#include <algorithm>

#include "patina/asset/strength_map.h"
#include "patina/inverse/fit_slots.h"
#include "patina/inverse/unseen.h"
#include "patina/views/strength_views.h"

namespace patina::inverse {
namespace {

// Strength of a fitted map's texels at the size of `texels`, [h,w,1].
Image strength_of(const render::Scene& scene, std::span<const asset::Map> strength, const FittedMap& map,
                  const Image& texels) {
  return asset::strength_of_texels(views::asset_primitives(scene),
                                   strength[static_cast<size_t>(map.material)], map.field.delta, texels.width,
                                   texels.height, map.material);
}

// Lets the change of the maps that do so go on over texels that no view saw. Where strengths differ it is the
// change at full strength that goes on, and each texel takes its share of it.
void fill_unseen(const render::Scene& scene, std::span<const asset::Map> strength, FitState& state) {
  // Below this strength a texel's own change says little of what the full one would be.
  constexpr float kLeastStrength = 0.1f;
  for (FittedMap& map : state.fitted) {
    if (!fit_slot(map.slot).fills_unseen) continue;
    Image& delta = map.field.delta.texels;
    SurfaceTexels surface = surface_texels(scene, map.field.delta, delta.width, delta.height, map.material);
    const Image share = strength.empty() ? Image(delta.width, delta.height, 1, 1.0f)
                                         : strength_of(scene, strength, map, delta);
    const auto channels = static_cast<size_t>(delta.channels);
    Image full = delta;
    for (size_t i = 0; i < delta.pixels.size(); ++i)
      full.pixels[i] /= std::max(share.pixels[i / channels], kLeastStrength);
    for (size_t i = 0; i < share.pixels.size(); ++i)
      if (share.pixels[i] <= 0.0f) surface.covered.pixels[i] = 0.0f;
    const Image filled = spread_to_unseen(full, map.evidence, surface);
    for (size_t i = 0; i < delta.pixels.size(); ++i)
      if (filled.pixels[i] != full.pixels[i]) delta.pixels[i] = filled.pixels[i] * share.pixels[i / channels];
    for (size_t i = 0; i < surface.p_world.size(); ++i)
      if (surface.covered.pixels[i] > 0.0f) map.evidence.pixels[i] = map.may_change.pixels[i] = 1.0f;
  }
}

// Texels of a field without strength take the change beside them, as padding does: a field is coarser than
// its texture, in which a border then stays where the mask has it.
void pad_masked(const render::Scene& scene, std::span<const asset::Map> strength, FitState& state) {
  for (FittedMap& map : state.fitted) {
    const Image share = strength_of(scene, strength, map, map.field.delta.texels);
    for (size_t i = 0; i < share.pixels.size(); ++i)
      if (share.pixels[i] <= 0.0f) map.evidence.pixels[i] = 0.0f, map.may_change.pixels[i] = 1.0f;
  }
}

// Texels without strength are as they were.
void restore_masked(const render::Scene& scene, std::span<const asset::Map> strength, const FitState& state,
                    const std::vector<asset::MaterialMaps>& base, std::vector<asset::MaterialMaps>& maps) {
  for (const FittedMap& map : state.fitted) {
    const auto m = static_cast<size_t>(map.material);
    Image& texels = slot_map(maps[m], map.slot).texels;
    // Even `base` of the same size may differ from the scene's maps by rounding.
    const Image& own = slot_map(scene.asset_materials()[m], map.slot).texels;
    const bool same_size = own.width == texels.width && own.height == texels.height;
    const Image& before = same_size ? own : slot_map(base[m], map.slot).texels;
    const Image share = strength_of(scene, strength, map, texels);
    const auto channels = static_cast<size_t>(texels.channels);
    for (size_t i = 0; i < share.pixels.size(); ++i)
      if (share.pixels[i] <= 0.0f)
        std::copy_n(&before.pixels[i * channels], channels, &texels.pixels[i * channels]);
  }
}

}  // namespace

FitResult result_of(const render::Scene& scene, FitState& state, const std::vector<asset::MaterialMaps>& base,
                    std::span<const asset::Map> strength, bool fills_unseen) {
  FitResult result;
  result.loss = std::move(state.loss);
  result.changed.resize(base.size());
  result.evidence.resize(base.size());
  for (size_t m = 0; m < base.size(); ++m) {
    const Image& texels = base[m].base_color.texels;
    result.evidence[m] = Image(texels.width, texels.height, 1);
  }
  for (const FittedMap& map : state.fitted) {
    const auto m = static_cast<size_t>(map.material);
    result.changed[m].set(index_of(map.slot));
    if (map.slot != asset::MapSlot::kBaseColor) continue;
    result.density.push_back(
        {map.material, result.evidence[m].width, result.evidence[m].height, map.texels_per_pixel});
    asset::Map evidence = map.field.delta;
    evidence.texels = map.evidence;
    result.evidence[m] = asset::resized(evidence, result.evidence[m].width, result.evidence[m].height).texels;
  }
  if (fills_unseen) fill_unseen(scene, strength, state);
  if (!strength.empty()) pad_masked(scene, strength, state);
  result.maps = apply_changes(base, state.fitted, Padding::kIslands);
  if (!strength.empty()) restore_masked(scene, strength, state, base, result.maps);
  return result;
}

}  // namespace patina::inverse
