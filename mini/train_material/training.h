// Trains the network of the material prior.
#pragma once

#include <filesystem>

#include "patina/prior/material_network.h"
#include "train_mini/run.h"

namespace patina::train_material {

struct MaterialTraining {
  train_mini::RunOptions run;
  int64_t batch = 8;  // cuts of `side` a step
  int64_t side = 128;
  bool from_model = false;  // begins with the weights of MODEL where WORK holds no checkpoint
};

/// WORK holds samples (training/, held_out/) and gets material.checkpoint and material.log; MODEL/config.json
/// says the sizes, and the weights are written beside it. Goes on where an earlier call stopped.
void train_material(const std::filesystem::path& work, const std::filesystem::path& model,
                    const MaterialTraining& options);

/// The network of a finished model. Throws Error.
prior::MaterialNetwork read_material_network(const std::filesystem::path& model);

}  // namespace patina::train_material
