// The diffusion model as the rest of patina sees it: a folder of weights in, edited views out. No Torch type
// passes this header.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "patina/attention/attention.h"
#include "patina/base/progress.h"
#include "patina/image/image.h"

namespace patina::diffusion {

enum class Scheduler { kDdim, kPndm, kEuler, kEulerAncestral, kDpmSolverPp2m, kDpmSolverPp2mKarras, kUniPc };
enum class Dtype { kAuto, kF32, kBf16, kF16 };  // kF16: on CUDA alone
enum class Device { kAuto, kCpu, kCuda };
enum class BiasScaling { kAdditive, kPaper };  // β = w or β = w/√d

enum class PredictionChoice { kAuto, kEpsilon, kV };  // what the U-Net was trained to tell

/// A low-rank change of the weights [Hu2022] and how much of it.
struct LoraChoice {
  std::filesystem::path file;
  float weight = 1;
  bool operator==(const LoraChoice&) const = default;
};

/// Where the components of a model lie; an empty path takes the component from `model`, else from the model
/// folders. Each may be a folder, a file, or the name of a file in the model folders (model_parts.h).
struct ModelPaths {
  std::filesystem::path model;  // a diffusers folder or a single-file checkpoint
  std::filesystem::path vae;
  std::filesystem::path controlnet_tile;    // default: <model>/controlnet_tile
  std::filesystem::path controlnet_normal;  // default: <model>/controlnet_normal
  std::filesystem::path text_encoder = {}, tokenizer = {};
  std::vector<LoraChoice> loras = {};
  std::vector<std::filesystem::path> embeddings = {};  // textual inversion
  std::vector<std::filesystem::path> model_dirs = {};  // folders of other tools, where models are looked for
  PredictionChoice prediction = PredictionChoice::kAuto;
};

struct ModelOptions {
  Dtype dtype = Dtype::kAuto;
  int num_threads = 0;            // 0: all processors
  bool low_memory = false;        // all networks but the U-Net are read anew for each use
  Device device = Device::kAuto;  // kAuto: CUDA where patina was built with it and finds a GPU
};

/// Looks at the folders and weight files of a model without loading it. Throws Error that names what is
/// missing, broken or a pickle.
void check_model(const ModelPaths& paths);

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

struct DetailInputs {
  int grid = 1;                     // views a side
  std::vector<Image> tile_views;    // grid² × [H,W,3] sRGB [0,1]: tile condition and start image
  std::vector<Image> normal_views;  // grid² × [H,W,3] [0,1]
  std::vector<float> noise;         // [C, grid·H/scale, grid·W/scale] f32, unit variance
  std::vector<attention::KeyBuckets>
      bias_levels;  // finest first; empty: no bias; levels coarser than the U-Net's coarsest are not used
  std::vector<Image> start_views = {};  // grid² × [H,W,3] sRGB [0,1]: start image where it is not the tile
                                        // condition; empty: tile_views
};

/// Classifier-free guidance [Ho2022]: how strong, and from which words on. A model may name its own as
/// `_guidance_scale` and `_negative_prompt` in model_index.json, which other programs pass over.
struct Guidance {
  float scale = 7.5f;
  std::string negative_prompt = {};
};

/// DetailOptions::guidance_scale: the model's own, 7.5 where it names none.
inline constexpr float kAutoGuidanceScale = 0;

struct DetailOptions {
  std::string prompt = {};                                    // with weights as prompt.h reads it
  std::optional<std::string> negative_prompt = std::nullopt;  // nullopt: the model's own, most often none
  int clip_skip = 1;  // 1: the whole text encoder; n leaves out its last n - 1 layers
  int num_steps = 20;
  float guidance_scale = kAutoGuidanceScale;  // 1: no guidance, one evaluation a step
  float strength = 1.0f;                      // (0,1]: share of the steps that is run [Meng2022]
  float tile_scale = 1.0f, normal_scale = 1.0f;
  // [0,1], times tile_scale up to 1: share of what the VAE loses of the tile views that the edited views get
  // back. The paper's edit and diffusers' have none of it.
  float fine_detail = 1.0f;
  Scheduler scheduler = Scheduler::kUniPc;
  float bias_weight = 0;  // w; 0: no bias
  BiasScaling bias_scaling = BiasScaling::kAdditive;
  bool bias_controlnet = false;  // the ControlNets' self-attention too
  uint64_t seed = 0;             // of the noise that ancestral schedulers draw
};

/// What the options ask for, or the model's own where they leave it open; a scale of 1 goes with no words.
Guidance guidance_of(const Model& model, const DetailOptions& options);

/// Where a run stands between two steps, as bytes that restore it exactly; for resuming a killed run.
struct Checkpoint {
  int next_step = 0;
  std::vector<uint8_t> bytes;
};
struct DetailHooks {
  std::function<void(const Checkpoint&)> on_checkpoint;  // after every step; may be empty
  std::optional<Checkpoint> resume;                      // from an earlier call with equal inputs and options
};

/// Bytes that generate_detail needs for views of this size.
struct DetailMemory {
  int64_t weights = 0;      // of the networks that are in memory at once, and of the libraries
  int64_t activations = 0;  // what they compute on, at the most
};
DetailMemory predict_memory(const Model& model, int grid, int view_width, int view_height,
                            const DetailOptions& options);

/// Image-to-image with two ControlNets over the whole grid at once [Hadadan2025, Sec. 4], and what the VAE
/// lost of the renders put back. Encodes and decodes view by view. Returns grid² sRGB images [H,W,3] in
/// [0,1]. Throws Error{kUsage} if sizes do not fit.
std::vector<Image> generate_detail(const Model& model, const DetailInputs& inputs,
                                   const DetailOptions& options, const DetailHooks& hooks,
                                   const Progress& progress);

}  // namespace patina::diffusion
