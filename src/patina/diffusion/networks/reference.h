// Pictures that the networks look at beside the views: reference attention. A reference passes through the
// same U-Net at the same noise level, and what its self-attentions see becomes further keys and values for
// the views' (as "reference-only" control of Stable Diffusion web UIs does it).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <ATen/core/Tensor.h>

#include "patina/nn/recorder.h"

namespace patina::diffusion {

/// The inputs [1,M,C] of every self-attention of one evaluation, by the name of the norm before it.
using ReferenceTokens = std::map<std::string, at::Tensor>;
/// Keeps them in `tokens`, which outlives the recorder.
nn::Recorder record_reference(ReferenceTokens& tokens);

/// How much each latent pixel of the views sees of a reference, at every resolution of a U-Net.
class ReferenceWeights {
 public:
  /// `weights` [H,W] f32, 0 or more, at the finest of `num_levels` resolutions: 1 counts like the views' own
  /// pixels, 0 not at all.
  ReferenceWeights(const at::Tensor& weights, size_t num_levels);

  /// Their logarithms [1,1,height·width]. Throws Error{kUsage} unless height × width is a resolution.
  const at::Tensor& log_at(int64_t height, int64_t width) const;

 private:
  struct Level {
    int64_t height, width;
    at::Tensor log_weights;
  };
  std::vector<Level> levels_;
};

/// One reference at one step.
struct Reference {
  const ReferenceTokens* tokens = nullptr;
  const ReferenceWeights* weights = nullptr;
};

}  // namespace patina::diffusion
