// Measures of a run that the report and the ablation share.
#pragma once

#include <cmath>
#include <span>

#include <nlohmann/json.hpp>

#include "patina/pipeline/stages.h"

namespace patina::pipeline {

/// A number as JSON; null where it is not finite, which JSON cannot say.
inline nlohmann::json json_number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

/// The loss's weights, one [H,W,1] image a view, so that untrusted silhouettes do not count.
std::vector<Image> measure_weights(const Strength& strength, const RenderedViews& views, int boundary_pixels);

/// Mean over the views of a measure between two pictures under such weights; views in which nothing counts
/// (NaN) are left out, NaN if that is all.
template <class Measure>
double mean_over_views(std::span<const Image> a, std::span<const Image> b, std::span<const Image> weights,
                       Measure measure) {
  double sum = 0, count = 0;
  for (size_t v = 0; v < a.size(); ++v)
    if (const double value = measure(a[v], b[v], weights[v]); !std::isnan(value)) sum += value, ++count;
  return sum / count;
}

/// {"edit_correlation", "edit_psnr", "covisible_pixels"} of the edited views.
nlohmann::json consistency_metrics(const Workbench& bench, const RenderedViews& views,
                                   std::span<const Image> edited);

}  // namespace patina::pipeline
