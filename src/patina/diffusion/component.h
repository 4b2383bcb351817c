// From the stored tensors of a network to the network: tensors are read under diffusers' names, changed by
// LoRAs on the way.
#pragma once

#include <filesystem>

#include "patina/diffusion/lora.h"
#include "patina/diffusion/network_part.h"
#include "patina/nn/weights.h"

namespace patina::diffusion {

/// The tensors of a table, with W + Σ scale · B A in f32 where `deltas` has some. Both must outlive it, not
/// the tensors.
class TableWeights final : public nn::WeightSource {
 public:
  explicit TableWeights(const TensorTable& table, const LoraDeltas* deltas = nullptr)
      : table_(table), deltas_(deltas) {}
  std::string where() const override { return table_.where.string(); }
  bool has(const std::string& name) const override { return table_.tensors.contains(name); }
  at::Tensor find(const std::string& name, at::IntArrayRef expected, at::ScalarType type) override;
  std::vector<std::string> names() const override;
  std::string stored_name(const std::string& name) const override { return table_.stored_name(name); }

 private:
  const TensorTable& table_;
  const LoraDeltas* deltas_;
};

/// Whether shapes differ by trailing ones alone: 1×1 convolutions and linear layers.
bool same_but_ones(at::IntArrayRef a, at::IntArrayRef b);

/// A network of these weights, as `type`. Throws Error that names every tensor that does not fit.
template <class Network, class Config>
Network load_network(const NetworkPart<Config>& part, at::ScalarType type,
                     const LoraDeltas* deltas = nullptr) {
  TableWeights source(part.table, deltas);
  nn::WeightReader weights(source, type);
  Network network(part.config, weights);
  weights.finish();
  return network;
}

}  // namespace patina::diffusion
