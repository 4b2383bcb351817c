// What a fit begins with: which pixels count, which maps change and at what size.
#pragma once

#include <span>
#include <vector>

#include "patina/inverse/fit_state.h"
#include "patina/inverse/light_cache.h"

namespace patina::inverse {

/// `inputs` again. Throws Error{kUsage} unless there is one edited image a view, of the view's size.
FitInputs checked(const FitInputs& inputs, const render::Scene& scene);

/// loss_weight of every view for the materials that may change.
std::vector<Image> view_weights(const render::Scene& scene, const FitInputs& inputs,
                                const FitOptions& options);

/// The scene's asset materials, their fitted maps at the size that they will be written with.
std::vector<asset::MaterialMaps> enlarged_maps(const render::Scene& scene, const FitInputs& inputs,
                                               std::span<const CachePixel> pixels, const FitOptions& options);

/// The state before the first iteration; `seen` from trace_seen_points, `base` from enlarged_maps. No fitted
/// maps where no view shows a surface with UVs and a material that may change.
FitState initial_state(const render::Scene& scene, const FitInputs& inputs,
                       std::span<const CachePixel> pixels, std::span<const SeenPoint> seen,
                       std::span<const asset::MaterialMaps> base, const FitOptions& options);

}  // namespace patina::inverse
