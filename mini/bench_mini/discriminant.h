// Regularised linear discriminant analysis: classes as Gaussians with one covariance, which is shrunk toward
// a sphere [Friedman1989]. A class may have several centres, one a source (mixture discriminant analysis with
// known components [Hastie1996]): green marble and white marble are both marble, and their mean is neither.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace patina::bench {

struct LabelledPoint {
  std::span<const float> features;  // all points have as many
  int label = 0;                    // in [0, number of classes)
  std::string source;               // points of one label and source have one centre
};

struct Discriminant {
  int num_classes = 0;
  std::vector<float> mean, scale;         // of the features: standardised are (x − mean) / scale
  std::vector<int> label;                 // [centres]
  std::vector<std::vector<float>> slope;  // [centres][features], for standardised features
  std::vector<float> offset;              // [centres]
};

/// Classes weigh alike, and sources of a class alike, however many points they have. `shrinkage` in (0,1].
Discriminant train_discriminant(std::span<const LabelledPoint> points, int num_classes, float shrinkage);

/// Probabilities of the classes [num_classes] of one point. `temperature` > 1 tempers them: windows of one
/// picture are not independent, nor Gaussian.
std::vector<float> class_probabilities(const Discriminant& d, std::span<const float> features,
                                       float temperature);

nlohmann::json to_json(const Discriminant& d);
Discriminant discriminant_from_json(const nlohmann::json& json);

}  // namespace patina::bench
