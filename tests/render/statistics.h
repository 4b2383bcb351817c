// Statistical tests for samplers and images. Every p-value is compared with a Šidák-corrected bound, so that
// a whole group of tests raises a false alarm with the stated probability; with fixed seeds the outcome is
// the same on every run.
#pragma once

#include <functional>
#include <vector>

#include "patina/base/math.h"

namespace patina::render::test {

/// Chance that a χ² variable of `degrees` degrees of freedom exceeds `statistic`.
double chi_squared_p_value(double statistic, int degrees);
/// Two-sided chance of a standard normal variable beyond ±|z|.
double normal_p_value(double z);
/// The bound for each of `num_tests` p-values such that all together have significance `significance`.
double sidak_bound(int num_tests, double significance = 0.01);

/// Integral over [x0,x1] × [y0,y1], refined where the integrand is uneven.
double integrate(const std::function<double(double, double)>& f, double x0, double x1, double y0, double y1);

/// Integral of f(direction) dω over the hemisphere about +Z.
double integrate_hemisphere(const std::function<double(const vec3&)>& f);

struct ChiSquared {
  double p_value = 0;
  double total = 0;  // integral of the density over the hemisphere
  int bins = 0;
};

/// Compares directions of the hemisphere about +Z with a density per steradian. `lost` samples gave no
/// direction: the density must leave room for them.
ChiSquared chi_squared_hemisphere(const std::vector<vec3>& samples, int lost,
                                  const std::function<double(const vec3&)>& pdf);

/// Pearson's statistic with bins of small expectation pooled.
double chi_squared_bins(const std::vector<double>& observed, const std::vector<double>& expected,
                        int* bins = nullptr);

}  // namespace patina::render::test
