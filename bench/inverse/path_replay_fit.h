// What an iteration of a fit costs that casts its paths anew every time, as a general differentiable renderer
// does.
#pragma once

#include "recovery/recovery.h"

namespace patina::bench {

/// Seconds of one iteration over all pixels that count: `paths` paths a pixel recorded, shaded,
/// differentiated and added to the texels.
double path_replay_iteration_seconds(const test::Recovery& recovery, const inverse::FitOptions& options,
                                     int paths);

}  // namespace patina::bench
