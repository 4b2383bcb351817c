// The loss curve of the fit as an inline SVG that takes its colours from the page.
#pragma once

#include <span>
#include <string>

namespace patina::report {

/// An <svg> element: loss over iterations, logarithmic where the values span more than a factor of twenty.
/// Iterations whose loss is not finite are left out of the line. Empty if fewer than two values are finite.
std::string loss_plot(std::span<const float> loss);

}  // namespace patina::report
