// From the state of a fit to what it returns.
#pragma once

#include <vector>

#include "patina/inverse/fit_state.h"

namespace patina::inverse {

/// What the fitted maps have become on top of `base`, with all that is known of them but the PSNR. The end of
/// `state`. `strength`: as FitInputs has it. `fills_unseen`: texels that no view saw get the change around
/// them.
FitResult result_of(const render::Scene& scene, FitState& state, const std::vector<asset::MaterialMaps>& base,
                    std::span<const asset::Map> strength, bool fills_unseen);

}  // namespace patina::inverse
