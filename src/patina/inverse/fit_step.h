// One step of descent over all fitted maps.
#pragma once

#include <vector>

#include "patina/inverse/fit_state.h"

namespace patina::inverse {

/// Moves every map that has joined by now along the gradient of loss and prior. `d_delta`: the loss's
/// gradient (Evaluator::d_delta), overwritten.
void step(FitState& state, std::vector<Image>& d_delta, const FitOptions& options);

}  // namespace patina::inverse
