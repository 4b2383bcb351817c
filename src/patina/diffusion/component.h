// One component of a diffusers model: a folder with config.json and a weight file.
#pragma once

#include <filesystem>

#include "patina/nn/weights.h"

namespace patina::diffusion {

/// The weight file of one component's folder. Throws Error{kNotFound} that says what was looked for, and
/// refuses pickles.
std::filesystem::path weight_file(const std::filesystem::path& folder);

/// A network of the folder's weights, as `type`. Throws Error that names every tensor that does not fit.
template <class Network, class Config>
Network load_network(const Config& config, const std::filesystem::path& folder, at::ScalarType type) {
  const nn::SafeTensors file(weight_file(folder));
  nn::FileWeights source(file);
  nn::WeightReader weights(source, type);
  Network network(config, weights);
  weights.finish();
  return network;
}

}  // namespace patina::diffusion
