#include "random_weights.h"

#include <cmath>

#include <ATen/ATen.h>

namespace patina::bench {

at::Tensor RandomWeights::find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) {
  shapes_[name] = expected.vec();
  if (expected.size() == 1) {
    const bool gain = name.size() > 7 && name.compare(name.size() - 7, 7, ".weight") == 0;
    return at::full(expected, gain ? 1.0 : 0.0, at::dtype(type));
  }
  double fan_in = 1;
  for (size_t axis = 1; axis < expected.size(); ++axis) fan_in *= static_cast<double>(expected[axis]);
  return (at::randn(expected) / std::sqrt(fan_in)).to(type);
}

double RandomWeights::flops_an_output(const std::string& name) const {
  const auto found = shapes_.find(name + ".weight");
  if (found == shapes_.end() || found->second.size() < 2) return 0;
  double flops = 2;
  for (size_t axis = 1; axis < found->second.size(); ++axis)
    flops *= static_cast<double>(found->second[axis]);
  return flops;
}

}  // namespace patina::bench
