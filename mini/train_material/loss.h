// What the network is trained for: maps near the truth, and errors that say how near.
#pragma once

#include <map>
#include <string>

#include <ATen/core/Tensor.h>

#include "patina/prior/material_network.h"
#include "records.h"

namespace patina::train_material {

struct Loss {
  at::Tensor total;                     // scalar
  std::map<std::string, double> parts;  // for the log: mean absolute errors on the object
};

/// Negative log-likelihoods of Laplace distributions with the estimated scale for base colour, roughness and
/// slopes, each pixel weighed by the square root of its scale, so that what is hard to tell is learnt too
/// [Seitzer2022]; cross entropy for metals. `samples` of which the whole batch consists weigh alike.
Loss loss_of(const prior::MaterialOutputs& outputs, const Truth& truth);

}  // namespace patina::train_material
