// What the diffusion model can be told, as plain values: where its files lie, how it computes, how it edits.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

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
  bool operator==(const ModelPaths&) const = default;
};

struct ModelOptions {
  Dtype dtype = Dtype::kAuto;
  bool low_memory = false;        // all networks but the U-Net are read anew for each use
  Device device = Device::kAuto;  // kAuto: CUDA where patina was built with it and finds a GPU
};

/// Classifier-free guidance [Ho2022]: how strong, and from which words on. A model may name its own as
/// `_guidance_scale` and `_negative_prompt` in model_index.json, which other programs pass over.
struct Guidance {
  float scale = 7.5f;
  std::string negative_prompt = {};
};

/// Words for one part of the picture, in place of the prompt.
struct PartPrompt {
  std::string prompt;
  std::optional<std::string> negative_prompt = std::nullopt;  // nullopt: that of the whole picture
  bool operator==(const PartPrompt&) const = default;
};

/// EditOptions::guidance_scale: the model's own, 7.5 where it names none.
inline constexpr float kAutoGuidanceScale = 0;

struct EditOptions {
  std::string prompt = {};                                    // with weights as prompt.h reads it
  std::optional<std::string> negative_prompt = std::nullopt;  // nullopt: the model's own, most often none
  std::vector<PartPrompt> part_prompts = {};  // of the parts that EditInputs::part_views shows
  int clip_skip = 1;                          // 1: the whole text encoder; n leaves out its last n - 1 layers
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

}  // namespace patina::diffusion
