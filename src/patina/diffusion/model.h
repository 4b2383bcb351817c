// A diffusion model as the rest of patina sees it: the parts that model_parts.h found in, an opaque model
// out. No Torch type passes this header.
#pragma once

#include <memory>
#include <string>

#include "patina/diffusion/model_parts.h"
#include "patina/diffusion/options.h"

namespace patina::diffusion {

/// Whether this patina was built with CUDA and finds a device.
bool has_cuda();

/// Throws Error if there is no such device here, or it does not compute in this precision.
void check_device(Device device, Dtype dtype);

/// A loaded model: weights are memory-mapped. Opaque; move-only.
class Model {
 public:
  /// `parts` as find_model_parts(paths) gives them; they may go afterwards. Throws Error that names the file
  /// and tensor: missing, wrongly shaped (expected and found), malformed. Throws as check_device.
  Model(const ModelParts& parts, const ModelOptions& options);
  ~Model();
  Model(Model&&) noexcept;
  Model& operator=(Model&&) noexcept;

  int latent_scale() const;  // image pixels a latent pixel, from the VAE's config
  int latent_channels() const;
  Dtype dtype() const;              // what kAuto became
  Device device() const;            // likewise
  std::string description() const;  // family, parameters, precision: one line for logs and config.json

  struct State;
  const State& state() const { return *state_; }

 private:
  std::unique_ptr<State> state_;
};

/// What the options ask for, or the model's own where they leave it open; a scale of 1 goes with no words.
Guidance guidance_of(const Model& model, const EditOptions& options);

}  // namespace patina::diffusion
