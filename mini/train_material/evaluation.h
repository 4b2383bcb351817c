// How good the estimates are on samples of shapes, materials and environments that were never trained on,
// beside two estimates that need no network.
#pragma once

#include <string>

#include <ATen/core/Tensor.h>

#include "patina/prior/material_network.h"
#include "records.h"

namespace patina::train_material {

/// Over the pixels that the object fills. "Changed" are pixels where a map differs: base colour by 0.03,
/// roughness by 0.05 or the normal by 5°, or a metal became none or the other way round.
struct Measures {
  double base_db = 0, base_db_changed = 0;      // PSNR of sRGB values, of all pixels together
  double roughness = 0, roughness_changed = 0;  // mean absolute error
  double metallic_changed = 0,
         metallic_kept = 0;      // share on the right side of ½: where it changed sides, elsewhere
  double angle = 0;              // degrees between estimated and true normals, mean over changed pixels
  double slope_correlation = 0;  // of estimated and true slopes on changed pixels
};

/// Of the network's expected errors: the share of pixels whose error is below it (63 % if the errors are of
/// Laplace distributions and their scales are right), and mean error / mean expected error (1).
struct Calibration {
  double within = 0, ratio = 0;
};

struct Evaluation {
  int64_t samples = 0;
  Measures network, clean, divided;  // divided: clean maps, with divided_base_color()
  Calibration base, roughness, slope;
};

struct EvaluationOptions {
  int64_t samples = 100;  // at most, spread over what there is
  int64_t reduction = 1;  // 2: at half the size
  bool disturb = false;   // as in training, by a fixed seed
};
Evaluation evaluate(const prior::MaterialNetwork& network, const Records& records,
                    const EvaluationOptions& options);

/// A Markdown table.
std::string table_of(const Evaluation& evaluation);

/// The planes of a sample [1,kNumPlanes,H,W] as evaluate() sees it.
at::Tensor evaluated_sample(const Records& records, int64_t index, const EvaluationOptions& options);

}  // namespace patina::train_material
