#include "statistics.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace patina::render::test {
namespace {

/// Regularised upper incomplete gamma function Q(a, x): series below a + 1, continued fraction above [NIST
/// DLMF, 8.11 and 8.9].
double gamma_q(double a, double x) {
  if (x <= 0) return 1.0;
  const double scale = std::exp(a * std::log(x) - x - std::lgamma(a));
  if (x < a + 1) {
    double term = 1.0 / a, sum = term;
    for (int n = 1; n < 10000 && std::abs(term) > 1e-16 * std::abs(sum); ++n) {
      term *= x / (a + n);
      sum += term;
    }
    return 1.0 - scale * sum;
  }
  double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
  for (int n = 1; n < 10000; ++n) {
    const double an = -n * (n - a);
    b += 2;
    d = 1 / (an * d + b);
    c = b + an / c;
    const double factor = c * d;
    h *= factor;
    if (std::abs(factor - 1) < 1e-15) break;
  }
  return scale * h;
}

constexpr int kMaxDepth = 9;

double midpoints(const std::function<double(double, double)>& f, double x0, double x1, double y0, double y1) {
  constexpr int kSide = 4;
  double sum = 0;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j)
      sum += f(x0 + (x1 - x0) * (i + 0.5) / kSide, y0 + (y1 - y0) * (j + 0.5) / kSide);
  return sum * (x1 - x0) * (y1 - y0) / (kSide * kSide);
}

double refine(const std::function<double(double, double)>& f, double x0, double x1, double y0, double y1,
              double whole, int depth) {
  const double x = 0.5 * (x0 + x1), y = 0.5 * (y0 + y1);
  const double a = midpoints(f, x0, x, y0, y), b = midpoints(f, x, x1, y0, y), c = midpoints(f, x0, x, y, y1),
               d = midpoints(f, x, x1, y, y1);
  const double sum = a + b + c + d;
  // Two levels are always taken: a feature that the first look misses altogether must not end the search.
  if (depth == 0 || (depth <= kMaxDepth - 2 && std::abs(sum - whole) < 1e-3 * std::abs(sum) + 1e-8))
    return sum + (sum - whole) / 3;
  return refine(f, x0, x, y0, y, a, depth - 1) + refine(f, x, x1, y0, y, b, depth - 1) +
         refine(f, x0, x, y, y1, c, depth - 1) + refine(f, x, x1, y, y1, d, depth - 1);
}

vec3 direction(double z, double azimuth) {
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  return vec3(static_cast<float>(r * std::cos(azimuth)), static_cast<float>(r * std::sin(azimuth)),
              static_cast<float>(z));
}

// Cells of the hemisphere: equal steps of azimuth and of t, where 1 − cos θ = t⁴; so the first rows are small
// enough to show the shape of a narrow lobe at the pole.
constexpr int kRows = 10, kColumns = 20;

double integrate_cell(const std::function<double(const vec3&)>& f, int row, int column) {
  return integrate(
      [&](double t, double azimuth) { return f(direction(1 - t * t * t * t, azimuth)) * 4 * t * t * t; },
      static_cast<double>(row) / kRows, (row + 1.0) / kRows, 2 * std::numbers::pi * column / kColumns,
      2 * std::numbers::pi * (column + 1) / kColumns);
}

}  // namespace

double chi_squared_p_value(double statistic, int degrees) {
  return gamma_q(0.5 * degrees, 0.5 * statistic);
}

double normal_p_value(double z) {
  return std::erfc(std::abs(z) / std::numbers::sqrt2);
}

double sidak_bound(int num_tests, double significance) {
  return 1.0 - std::pow(1.0 - significance, 1.0 / num_tests);
}

double integrate(const std::function<double(double, double)>& f, double x0, double x1, double y0, double y1) {
  return refine(f, x0, x1, y0, y1, midpoints(f, x0, x1, y0, y1), kMaxDepth);
}

double integrate_hemisphere(const std::function<double(const vec3&)>& f) {
  double sum = 0;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) sum += integrate_cell(f, row, column);
  return sum;
}

double chi_squared_bins(const std::vector<double>& observed, const std::vector<double>& expected, int* bins) {
  // Pool from the smallest expectation upwards until each pool expects at least ten.
  std::vector<size_t> order(expected.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return expected[a] < expected[b]; });
  double statistic = 0, o = 0, e = 0;
  int count = 0;
  for (size_t k = 0; k < order.size(); ++k) {
    o += observed[order[k]];
    e += expected[order[k]];
    if (e < 10 && k + 1 < order.size()) continue;
    if (e > 0) statistic += (o - e) * (o - e) / e, ++count;
    if (e <= 0 && o > 0) statistic += 1e9;  // samples where the density says there are none
    o = e = 0;
  }
  if (bins) *bins = count;
  return statistic;
}

ChiSquared chi_squared_hemisphere(const std::vector<vec3>& samples, int lost,
                                  const std::function<double(const vec3&)>& pdf) {
  const double count = static_cast<double>(samples.size()) + lost;
  std::vector<double> observed(kRows * kColumns + 1), expected(kRows * kColumns + 1);
  for (const vec3& d : samples) {
    const double t = std::pow(std::max(0.0, 1.0 - static_cast<double>(d.z)), 0.25);
    double azimuth = std::atan2(static_cast<double>(d.y), static_cast<double>(d.x));
    if (azimuth < 0) azimuth += 2 * std::numbers::pi;
    const int row = std::clamp(static_cast<int>(t * kRows), 0, kRows - 1);
    const int column =
        std::clamp(static_cast<int>(azimuth / (2 * std::numbers::pi) * kColumns), 0, kColumns - 1);
    ++observed[static_cast<size_t>(row * kColumns + column)];
  }
  ChiSquared out;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      const double mass = integrate_cell(pdf, row, column);
      expected[static_cast<size_t>(row * kColumns + column)] = mass * count;
      out.total += mass;
    }
  observed.back() = lost;
  expected.back() = std::max(0.0, 1.0 - out.total) * count;
  // Where nothing can be lost, rounding of the integral must not demand that something is.
  if (expected.back() < 1e-3 * count && lost == 0) expected.back() = 0;
  const double statistic = chi_squared_bins(observed, expected, &out.bins);
  out.p_value = chi_squared_p_value(statistic, out.bins - 1);
  return out;
}

}  // namespace patina::render::test
