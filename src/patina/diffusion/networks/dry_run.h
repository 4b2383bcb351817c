// Networks built of shapes alone: whether the tensors of a file fit, in milliseconds and without memory, and
// which tensors a configuration calls for.
#pragma once

#include <utility>
#include <vector>

#include "patina/diffusion/files/network_part.h"
#include "patina/nn/weights.h"

namespace patina::diffusion {

/// The shapes of a table's tensors, on Torch's meta device.
class ShapeWeights final : public nn::WeightSource {
 public:
  explicit ShapeWeights(const TensorTable& table) : table_(table) {}
  std::string where() const override { return table_.where.string(); }
  bool has(const std::string& name) const override { return table_.tensors.contains(name); }
  /// Throws Error{kUnsupported} for a tensor that is none of F32, F16, BF16, F64.
  at::Tensor find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) override;
  std::vector<std::string> names() const override;
  std::string stored_name(const std::string& name) const override { return table_.stored_name(name); }

 private:
  const TensorTable& table_;
};

/// The number of parameters. Throws Error that names every tensor that does not fit.
template <class Network, class Config>
int64_t check_tensors(const NetworkPart<Config>& part) {
  ShapeWeights source(part.table);
  nn::WeightReader weights(source, c10::ScalarType::Float);
  Network network(part.config, weights);
  weights.finish();
  return weights.count().parameters;
}

/// Answers every question with the shape that is asked for, and notes it.
class WishList final : public nn::WeightSource {
 public:
  std::vector<std::pair<std::string, std::vector<int64_t>>> wishes;

  std::string where() const override { return "configuration"; }
  bool has(const std::string&) const override { return false; }
  at::Tensor find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) override;
  std::vector<std::string> names() const override { return {}; }
};

/// Name and shape of every tensor of a network of this configuration, in the order of its layers.
template <class Network, class Config>
std::vector<std::pair<std::string, std::vector<int64_t>>> tensors_of(const Config& config) {
  WishList source;
  nn::WeightReader weights(source, c10::ScalarType::Float);
  Network network(config, weights);
  return source.wishes;
}

}  // namespace patina::diffusion
