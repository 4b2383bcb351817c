// A diffusion model as the rest of patina sees it: weight files in, an opaque model out. No Torch type passes
// this header.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "patina/diffusion/options.h"

namespace patina::diffusion {

/// Looks at the folders and weight files of a model without loading it. Throws Error that names what is
/// missing, broken or a pickle, or a setting of `scheduler`, if one is given, that patina lacks.
void check_model(const ModelPaths& paths, std::optional<Scheduler> scheduler = std::nullopt);

/// Throws Error if there is no such device here, or it does not compute in this precision.
void check_device(Device device, Dtype dtype);

/// Every file that a model is read from; what tells whether it changed.
std::vector<std::filesystem::path> model_files(const ModelPaths& paths);

/// A loaded model: weights are memory-mapped. Opaque; move-only.
class Model {
 public:
  /// Throws Error that names the file and tensor: missing, wrongly shaped (expected and found), malformed, a
  /// pickle. Throws as check_device.
  Model(const ModelPaths& paths, const ModelOptions& options);
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
