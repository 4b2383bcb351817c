// Weights of any network, made as they are asked for: time does not depend on their values.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "patina/nn/weights.h"

namespace patina::bench {

/// Gaussian, scaled by the fan-in so that activations stay in range; gains 1, biases 0. Remembers every
/// shape.
class RandomWeights final : public nn::WeightSource {
 public:
  std::string where() const override { return "random weights"; }
  bool has(const std::string& name) const override { return shapes_.count(name) > 0; }
  at::Tensor find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) override;
  std::vector<std::string> names() const override { return {}; }

  /// Multiplications and additions that the layer `name` spends on each number it puts out; 0 if it has no
  /// weight of two or more axes.
  double flops_an_output(const std::string& name) const;

 private:
  std::map<std::string, std::vector<int64_t>> shapes_;
};

}  // namespace patina::bench
