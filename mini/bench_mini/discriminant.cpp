#include "discriminant.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "patina/base/check.h"

namespace patina::bench {
namespace {

using nlohmann::json;
using Matrix = std::vector<std::vector<double>>;
using Vector = std::vector<double>;

// Lower triangular L with L Lᵀ = a. The shrinkage has made `a` positive definite.
Matrix cholesky(Matrix a) {
  const size_t n = a.size();
  for (size_t j = 0; j < n; ++j) {
    for (size_t k = 0; k < j; ++k) a[j][j] -= a[j][k] * a[j][k];
    PATINA_CHECK(a[j][j] > 0);
    a[j][j] = std::sqrt(a[j][j]);
    for (size_t i = j + 1; i < n; ++i) {
      for (size_t k = 0; k < j; ++k) a[i][j] -= a[i][k] * a[j][k];
      a[i][j] /= a[j][j];
    }
  }
  return a;
}

// x with L Lᵀ x = b.
Vector solved(const Matrix& l, Vector b) {
  const size_t n = b.size();
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < i; ++k) b[i] -= l[i][k] * b[k];
    b[i] /= l[i][i];
  }
  for (size_t i = n; i-- > 0;) {
    for (size_t k = i + 1; k < n; ++k) b[i] -= l[k][i] * b[k];
    b[i] /= l[i][i];
  }
  return b;
}

using Centre = std::pair<int, std::string>;  // label, source

}  // namespace

Discriminant train_discriminant(std::span<const LabelledPoint> points, int num_classes, float shrinkage) {
  PATINA_CHECK(!points.empty() && shrinkage > 0 && shrinkage <= 1);
  const size_t n = points.front().features.size();
  std::map<Centre, size_t> index_of;
  for (const LabelledPoint& p : points) {
    PATINA_CHECK(p.features.size() == n && p.label >= 0 && p.label < num_classes);
    index_of.try_emplace({p.label, p.source}, 0);
  }
  std::map<int, size_t> sources_of_label;
  Discriminant out{
      .num_classes = num_classes, .mean = {}, .scale = {}, .label = {}, .slope = {}, .offset = {}};
  for (auto& [centre, index] : index_of) {
    index = out.label.size();
    out.label.push_back(centre.first);
    ++sources_of_label[centre.first];
  }

  // A point's weight, so that all weights sum to one.
  std::vector<size_t> centre_of(points.size());
  Vector points_of(out.label.size(), 0.0), weight(points.size());
  for (size_t i = 0; i < points.size(); ++i)
    points_of[centre_of[i] = index_of.at({points[i].label, points[i].source})] += 1;
  for (size_t i = 0; i < points.size(); ++i)
    weight[i] = 1.0 / (points_of[centre_of[i]] * static_cast<double>(sources_of_label.at(points[i].label)) *
                       static_cast<double>(sources_of_label.size()));

  Vector mean(n, 0.0), variance(n, 0.0);
  for (size_t i = 0; i < points.size(); ++i)
    for (size_t f = 0; f < n; ++f) mean[f] += weight[i] * points[i].features[f];
  for (size_t i = 0; i < points.size(); ++i)
    for (size_t f = 0; f < n; ++f) variance[f] += weight[i] * std::pow(points[i].features[f] - mean[f], 2);
  for (size_t f = 0; f < n; ++f) {
    out.mean.push_back(static_cast<float>(mean[f]));
    out.scale.push_back(
        static_cast<float>(std::sqrt(variance[f]) + 1e-6));  // a feature that never varies: 0/1e-6
  }

  Matrix centres(out.label.size(), Vector(n, 0.0)), covariance(n, Vector(n, 0.0));
  const auto standardised = [&](size_t i, size_t f) {
    return (static_cast<double>(points[i].features[f]) - out.mean[f]) / out.scale[f];
  };
  for (size_t i = 0; i < points.size(); ++i)
    for (size_t f = 0; f < n; ++f) centres[centre_of[i]][f] += standardised(i, f) / points_of[centre_of[i]];
  Vector from_centre(n);
  for (size_t i = 0; i < points.size(); ++i) {
    for (size_t f = 0; f < n; ++f) from_centre[f] = standardised(i, f) - centres[centre_of[i]][f];
    for (size_t f = 0; f < n; ++f)
      for (size_t g = 0; g <= f; ++g) covariance[f][g] += weight[i] * from_centre[f] * from_centre[g];
  }
  double trace = 0;
  for (size_t f = 0; f < n; ++f) trace += covariance[f][f];
  for (size_t f = 0; f < n; ++f)
    for (size_t g = 0; g <= f; ++g)
      covariance[f][g] = (1 - shrinkage) * covariance[f][g] +
                         (f == g ? shrinkage * std::max(trace / static_cast<double>(n), 1e-9) : 0.0);

  // log p(x | centre) = slope·x + offset, up to what is common to all centres.
  const Matrix factor = cholesky(std::move(covariance));
  for (size_t c = 0; c < centres.size(); ++c) {
    const Vector slope = solved(factor, centres[c]);
    double length = 0;
    for (size_t f = 0; f < n; ++f) length += slope[f] * centres[c][f];
    out.slope.emplace_back(slope.begin(), slope.end());
    out.offset.push_back(static_cast<float>(-0.5 * length));
  }
  return out;
}

std::vector<float> class_probabilities(const Discriminant& d, std::span<const float> features,
                                       float temperature) {
  PATINA_CHECK_EQ(features.size(), d.mean.size());
  std::vector<float> x(features.size());
  for (size_t f = 0; f < x.size(); ++f) x[f] = (features[f] - d.mean[f]) / d.scale[f];
  std::vector<double> score(d.label.size());
  std::vector<int> centres_of(static_cast<size_t>(d.num_classes), 0);
  for (size_t c = 0; c < score.size(); ++c) {
    double sum = d.offset[c];
    for (size_t f = 0; f < x.size(); ++f) sum += static_cast<double>(d.slope[c][f]) * x[f];
    score[c] = sum / temperature;
    ++centres_of[static_cast<size_t>(d.label[c])];
  }
  const double highest = *std::max_element(score.begin(), score.end());
  std::vector<double> sums(static_cast<size_t>(d.num_classes), 0.0);
  double total = 0;
  for (size_t c = 0; c < score.size(); ++c) {
    const auto label = static_cast<size_t>(d.label[c]);
    const double likelihood = std::exp(score[c] - highest) / centres_of[label];
    sums[label] += likelihood, total += likelihood;
  }
  std::vector<float> out;
  for (const double sum : sums) out.push_back(static_cast<float>(sum / total));
  return out;
}

json to_json(const Discriminant& d) {
  return {{"num_classes", d.num_classes},
          {"mean", d.mean},
          {"scale", d.scale},
          {"label", d.label},
          {"slope", d.slope},
          {"offset", d.offset}};
}

Discriminant discriminant_from_json(const json& json) {
  return {.num_classes = json.at("num_classes").get<int>(),
          .mean = json.at("mean").get<std::vector<float>>(),
          .scale = json.at("scale").get<std::vector<float>>(),
          .label = json.at("label").get<std::vector<int>>(),
          .slope = json.at("slope").get<std::vector<std::vector<float>>>(),
          .offset = json.at("offset").get<std::vector<float>>()};
}

}  // namespace patina::bench
