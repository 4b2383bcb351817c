// From the stored tensors of a network to the network: tensors are read under diffusers' names, changed by
// LoRAs on the way.
#pragma once

#include <filesystem>

#include "patina/diffusion/files/lora.h"
#include "patina/diffusion/files/network_part.h"
#include "patina/diffusion/networks/dry_run.h"
#include "patina/diffusion/networks/held.h"
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

/// A network of these weights. Throws Error that names every tensor that does not fit.
template <class Network, class Config>
Network load_network(const NetworkPart<Config>& part, nn::Placement placement,
                     const LoraDeltas* deltas = nullptr) {
  TableWeights source(part.table, deltas);
  nn::WeightReader weights(source, placement);
  Network network(part.config, weights);
  weights.finish();
  return network;
}

/// Gives back the memory of the file pages that tensors of the table were read from.
void release_pages(const TensorTable& table);

/// Loads the network for good, or only checks it and reads it whenever it is used. Throws as load_network.
template <class Network, class Config>
Held<Network> hold_network(const NetworkPart<Config>& part, nn::Placement placement, bool resident,
                           const LoraDeltas& deltas = {}) {
  if (resident) return Held<Network>(load_network<Network>(part, placement, &deltas));
  const auto read = [part, placement, deltas] {
    const auto release = [table = part.table](const Network* network) {
      delete network;
      release_pages(table);
    };
    return std::shared_ptr<const Network>(new Network(load_network<Network>(part, placement, &deltas)),
                                          release);
  };
  return Held<Network>(part.config, check_tensors<Network>(part), read);
}

}  // namespace patina::diffusion
