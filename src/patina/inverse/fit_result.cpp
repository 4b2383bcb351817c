#include "patina/inverse/fit_result.h"

#include "patina/inverse/fit_slots.h"
#include "patina/inverse/unseen.h"

namespace patina::inverse {
namespace {

// Lets the change of the maps that do so go on over texels that no view saw.
void fill_unseen(const render::Scene& scene, FitState& state) {
  for (FittedMap& map : state.fitted) {
    if (!fit_slot(map.slot).fills_unseen) continue;
    Image& delta = map.field.delta.texels;
    const SurfaceTexels surface =
        surface_texels(scene, map.field.delta, delta.width, delta.height, map.material);
    delta = spread_to_unseen(delta, map.evidence, surface);
    for (size_t i = 0; i < surface.p_world.size(); ++i)
      if (surface.covered.pixels[i] > 0.0f) map.evidence.pixels[i] = map.may_change.pixels[i] = 1.0f;
  }
}

}  // namespace

FitResult result_of(const render::Scene& scene, FitState& state, const std::vector<asset::MaterialMaps>& base,
                    bool fills_unseen) {
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
  if (fills_unseen) fill_unseen(scene, state);
  result.maps = apply_changes(base, state.fitted, Padding::kIslands);
  return result;
}

}  // namespace patina::inverse
