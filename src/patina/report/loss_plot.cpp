#include "patina/report/loss_plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <fmt/format.h>

#include "patina/report/html.h"

namespace patina::report {
namespace {

// The drawing, in SVG units; the page scales it.
constexpr double kWidth = 720, kHeight = 260, kLeft = 58, kRight = 700, kTop = 14, kBottom = 216;

struct Axis {
  double low = 0, high = 1;  // values at the two ends
  bool logarithmic = false;

  // 0 at `low`, 1 at `high`.
  double place(double value) const {
    if (logarithmic) return std::log(value / low) / std::log(high / low);
    return (value - low) / (high - low);
  }
};

// The largest of 1, 2, 5 × 10^k that divides `range` into at least `parts`.
double round_step(double range, int parts) {
  const double rough = range / parts, decade = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * decade <= rough) return factor * decade;
  }
  return decade;
}

std::vector<double> ticks(const Axis& axis, int parts) {
  std::vector<double> out;
  if (axis.logarithmic) {
    const bool few_decades = axis.high / axis.low < 1e3;
    for (double decade = std::pow(10.0, std::floor(std::log10(axis.low))); decade <= axis.high; decade *= 10)
      for (const double factor : {1.0, 2.0, 5.0})
        if ((factor == 1.0 || few_decades) && factor * decade >= axis.low * 0.999 &&
            factor * decade <= axis.high * 1.001)
          out.push_back(factor * decade);
    return out;
  }
  const double step = round_step(axis.high - axis.low, parts);
  for (double i = std::ceil(axis.low / step - 1e-6) + 0.0; i * step <= axis.high + 1e-6 * step; ++i)
    out.push_back(i * step);
  return out;
}

// Mean of the finite values within `radius`; NaN where there is none.
std::vector<float> smoothed(std::span<const float> values, int radius) {
  std::vector<float> out(values.size());
  for (int i = 0; i < static_cast<int>(values.size()); ++i) {
    double sum = 0, count = 0;
    for (int k = std::max(0, i - radius); k <= std::min(static_cast<int>(values.size()) - 1, i + radius); ++k)
      if (std::isfinite(values[static_cast<size_t>(k)])) sum += values[static_cast<size_t>(k)], ++count;
    out[static_cast<size_t>(i)] =
        count > 0 ? static_cast<float>(sum / count) : std::numeric_limits<float>::quiet_NaN();
  }
  return out;
}

// The path's "d": one sub-path per run of drawable values. Long curves are thinned to two points per SVG
// unit.
std::string path_data(std::span<const float> values, const Axis& x, const Axis& y) {
  const size_t stride = std::max<size_t>(1, values.size() / static_cast<size_t>(2 * (kRight - kLeft)));
  std::string d;
  bool pen_down = false;
  for (size_t i = 0; i < values.size(); i += stride) {
    const double value = values[i];
    if (!std::isfinite(value) || (y.logarithmic && value <= 0)) {
      pen_down = false;
      continue;
    }
    d += fmt::format("{}{:.1f} {:.1f}", pen_down ? 'L' : 'M',
                     kLeft + (kRight - kLeft) * x.place(static_cast<double>(i)),
                     kBottom - (kBottom - kTop) * y.place(value));
    pen_down = true;
  }
  return d;
}

}  // namespace

std::string loss_plot(std::span<const float> loss) {
  std::vector<float> finite;
  std::copy_if(loss.begin(), loss.end(), std::back_inserter(finite),
               [](float v) { return std::isfinite(v); });
  if (finite.size() < 2) return "";
  const auto [low, high] = std::minmax_element(finite.begin(), finite.end());

  const Axis x{0, static_cast<double>(loss.size() - 1), false};
  Axis y{0, 1.06 * *high, false};
  if (*low > 0 && *high / *low > 20) y = {*low / 1.15, *high * 1.15, true};
  if (*low < 0) y.low = 1.06 * *low;
  if (!(y.high > y.low)) y.high = y.low + 1;  // all zero

  std::string svg = fmt::format(
      "<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"Loss over {} iterations, from {} "
      "to {}\">\n",
      kWidth, kHeight, loss.size(), number(finite.front()), number(finite.back()));
  for (const double tick : ticks(y, 4)) {
    const double at = kBottom - (kBottom - kTop) * y.place(tick);
    svg += fmt::format(
        "<path class=\"grid\" d=\"M{} {:.1f}H{}\"/><text x=\"{}\" y=\"{:.1f}\" "
        "text-anchor=\"end\">{:g}</text>\n",
        kLeft, at, kRight, kLeft - 8, at + 4, tick);
  }
  for (const double tick : ticks(x, 6)) {
    if (tick != std::floor(tick)) continue;
    const double at = kLeft + (kRight - kLeft) * x.place(tick);
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g}</text>\n", at, kBottom + 19,
                       tick);
  }
  svg += fmt::format("<path class=\"axis\" d=\"M{} {}H{}\"/>\n", kLeft, kBottom, kRight);
  svg += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\" class=\"unit\">iteration</text>\n", kRight,
                     kHeight - 4);
  svg += fmt::format("<text x=\"{}\" y=\"{}\" class=\"unit\">loss: relative squared error{}</text>\n", kLeft,
                     kHeight - 4, y.logarithmic ? ", logarithmic" : "");

  // The loss is measured on few samples and jumps: beneath, as measured; above, its running mean.
  constexpr size_t kSmoothFrom = 40;
  if (loss.size() >= kSmoothFrom) {
    svg += fmt::format("<path class=\"raw\" d=\"{}\"/>\n", path_data(loss, x, y));
    svg += fmt::format("<path class=\"curve\" d=\"{}\"/>\n",
                       path_data(smoothed(loss, static_cast<int>(loss.size() / 60)), x, y));
  } else {
    svg += fmt::format("<path class=\"curve\" d=\"{}\"/>\n", path_data(loss, x, y));
  }
  return svg + "</svg>\n";
}

}  // namespace patina::report
