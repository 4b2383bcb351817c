#include "evaluation.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "augment.h"

namespace patina::train_material {
namespace {

using at::Tensor;

constexpr double kBaseChanged = 0.03, kRoughnessChanged = 0.05, kDegreesChanged = 5;

// A weighted mean that grows.
struct Mean {
  double sum = 0, weight = 0;

  void add(const Tensor& values, const Tensor& weights) {
    sum += (values * weights).sum().item<double>();
    weight += weights.sum().item<double>();
  }
  double value() const { return weight > 0 ? sum / weight : 0; }
};

struct Maps {
  Tensor base_color, roughness, metallic, slope;
};

struct Sums {
  Mean base, base_changed, roughness, roughness_changed, metallic_changed, metallic_kept, angle;
  double cross = 0, own = 0, other = 0;  // Σ of products of slopes: estimate × truth, and squares

  Measures measures() const {
    const auto db = [](const Mean& square) { return -10 * std::log10(std::max(square.value(), 1e-10)); };
    return {db(base),
            db(base_changed),
            roughness.value(),
            roughness_changed.value(),
            metallic_changed.value(),
            metallic_kept.value(),
            angle.value(),
            own > 0 ? cross / std::sqrt(own * other) : 0};
  }
};

Tensor degrees_between(const Tensor& a, const Tensor& b) {
  return (a * b).sum({1}, true).clamp(-1, 1).acos() * (180 / M_PI);
}

// Where things changed, as weights.
struct Regions {
  Tensor all, changed, sides_changed, sides_kept;
};
Regions regions_of(const prior::MaterialInputs& inputs, const Truth& truth) {
  const Tensor sides = (inputs.metallic > 0.5) != (truth.metallic > 0.5);
  const Tensor changed = ((inputs.base_color - truth.base_color).abs().mean({1}, true) > kBaseChanged)
                             .logical_or((inputs.roughness - truth.roughness).abs() > kRoughnessChanged)
                             .logical_or(degrees_between(inputs.normal, truth.normal) > kDegreesChanged)
                             .logical_or(sides);
  const auto weights = [&](const Tensor& where) { return where.to(at::kFloat) * truth.weight; };
  return {truth.weight, weights(changed), weights(sides), weights(sides.logical_not())};
}

void add(Sums& sums, const Maps& maps, const prior::MaterialInputs& inputs, const Truth& truth,
         const Regions& regions) {
  const Tensor base = (maps.base_color.clamp(0, 1) - truth.base_color).square().mean({1}, true);
  const Tensor roughness = (maps.roughness.clamp(0, 1) - truth.roughness).abs();
  const Tensor right = ((maps.metallic > 0.5) == (truth.metallic > 0.5)).to(at::kFloat);
  sums.base.add(base, regions.all), sums.base_changed.add(base, regions.changed);
  sums.roughness.add(roughness, regions.all), sums.roughness_changed.add(roughness, regions.changed);
  sums.metallic_changed.add(right, regions.sides_changed), sums.metallic_kept.add(right, regions.sides_kept);
  sums.angle.add(degrees_between(prior::bent_normals(inputs.normal, maps.slope), truth.normal),
                 regions.changed);
  const auto product = [&](const Tensor& a, const Tensor& b) {
    return (a * b * regions.changed).sum().item<double>();
  };
  sums.cross += product(maps.slope, truth.slope);
  sums.own += product(maps.slope, maps.slope), sums.other += product(truth.slope, truth.slope);
}

struct Expected {
  Mean within, error, expected;

  void add(const Tensor& errors, const Tensor& scale, const Tensor& weight) {
    const Tensor channels = at::ones_like(errors) * weight;
    within.add((errors < scale).to(at::kFloat), channels);
    error.add(errors, channels), expected.add(scale.expand_as(errors), channels);
  }
  Calibration calibration() const {
    return {within.value(), expected.value() > 0 ? error.value() / expected.value() : 0};
  }
};

}  // namespace

Tensor evaluated_sample(const Records& records, int64_t index, const EvaluationOptions& options) {
  Tensor planes = records.record(index).unsqueeze(0);
  if (options.reduction > 1) planes = at::avg_pool2d(planes, options.reduction);
  if (!options.disturb) return planes;
  at::manual_seed(static_cast<uint64_t>(index));
  return disturbed(planes);
}

Evaluation evaluate(const prior::MaterialNetwork& network, const Records& records,
                    const EvaluationOptions& options) {
  const c10::InferenceMode inference;
  Evaluation out;
  out.samples = std::min(options.samples, records.size());
  Sums estimated, clean, divided;
  Expected base, roughness, slope;
  for (int64_t i = 0; i < out.samples; ++i) {
    const Tensor planes = evaluated_sample(records, i * records.size() / out.samples, options);
    const prior::MaterialInputs inputs = inputs_of(planes);
    const Truth truth = truth_of(planes);
    const Regions regions = regions_of(inputs, truth);
    const prior::MaterialOutputs y = network(inputs);
    const Tensor flat = at::zeros_like(truth.slope);
    add(estimated, {y.base_color, y.roughness, y.metallic_logit.sigmoid(), y.slope}, inputs, truth, regions);
    add(clean, {inputs.base_color, inputs.roughness, inputs.metallic, flat}, inputs, truth, regions);
    add(divided, {prior::divided_base_color(inputs), inputs.roughness, inputs.metallic, flat}, inputs, truth,
        regions);
    base.add((y.base_color - truth.base_color).abs(), y.base_color_error, truth.weight);
    roughness.add((y.roughness - truth.roughness).abs(), y.roughness_error, truth.weight);
    slope.add((y.slope - truth.slope).abs(), y.slope_error, truth.weight);
  }
  out.network = estimated.measures(), out.clean = clean.measures(), out.divided = divided.measures();
  out.base = base.calibration(), out.roughness = roughness.calibration(), out.slope = slope.calibration();
  return out;
}

std::string table_of(const Evaluation& e) {
  std::string out = "| " + std::to_string(e.samples) +
                    " samples | network | clean maps | divided colour |\n|---|---|---|---|\n";
  char line[160];
  const auto row = [&](const char* name, const char* format, double Measures::*member) {
    const std::string pattern = std::string("| %s | ") + format + " | " + format + " | " + format + " |\n";
    std::snprintf(line, sizeof line, pattern.c_str(), name, e.network.*member, e.clean.*member,
                  e.divided.*member);
    out += line;
  };
  row("base colour, dB", "%.2f", &Measures::base_db);
  row("base colour where something changed, dB", "%.2f", &Measures::base_db_changed);
  row("roughness, mean absolute error", "%.3f", &Measures::roughness);
  row("roughness where something changed", "%.3f", &Measures::roughness_changed);
  row("metallic right where it changed", "%.3f", &Measures::metallic_changed);
  row("metallic right elsewhere", "%.3f", &Measures::metallic_kept);
  row("normals where something changed, degrees off", "%.2f", &Measures::angle);
  row("slopes, correlation with the truth", "%.3f", &Measures::slope_correlation);
  out += "\n| expected errors | base colour | roughness | slope |\n|---|---|---|---|\n";
  std::snprintf(line, sizeof line, "| share of errors below (0.632) | %.3f | %.3f | %.3f |\n", e.base.within,
                e.roughness.within, e.slope.within);
  out += line;
  std::snprintf(line, sizeof line, "| mean error / mean expected (1) | %.3f | %.3f | %.3f |\n", e.base.ratio,
                e.roughness.ratio, e.slope.ratio);
  return out + line;
}

}  // namespace patina::train_material
