// One Gauss-Newton step over all fitted maps together. Base colour, roughness, metallic and normals explain
// one another; a step that solves for all of them at once goes along the valley between them, in which
// descent by each map's own gradient gets stuck.
#pragma once

#include <vector>

#include "patina/inverse/evaluate.h"
#include "patina/inverse/fit_state.h"

namespace patina::inverse {

/// Loss of the last evaluation, as a sum over pixels, and the priors on the present maps.
double objective(const FitState& state, const Evaluator& evaluator);

/// The change of parameters that minimises the linearised objective, with Marquardt's damping
/// [Marquardt1963], by preconditioned conjugate gradients. Maps that have not joined yet stay.
Parameters solve_step(const FitState& state, const Evaluator& evaluator, int iterations);

}  // namespace patina::inverse
