// All parts of a model, found and opened but not loaded: which file gives each network, the tokenizer, the
// scheduler's settings, LoRAs and learned words. No Torch here.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "patina/diffusion/files/embedding.h"
#include "patina/diffusion/files/families.h"
#include "patina/diffusion/files/lora.h"
#include "patina/diffusion/files/network_part.h"
#include "patina/diffusion/options.h"
#include "patina/diffusion/schedulers/schedulers.h"

namespace patina::diffusion {

/// A text encoder and what belongs to it alone.
struct TextPart {
  TextEncoderPart encoder;
  std::filesystem::path tokenizer = {};
  std::optional<int64_t> pad_id = {};  // where the family wants another than the tokenizer's files say
  std::vector<LearnedWord> words = {};
};

struct ModelParts {
  Family family = Family::kSd1;
  UNetPart unet;
  std::vector<TextPart> texts;
  VaePart vae;
  std::vector<ControlNetPart> controlnets;  // in the order of kControlKinds
  SchedulerConfig scheduler;
  Guidance guidance;            // where the user names nothing else
  bool ask_prediction = false;  // nothing tells what the U-Net predicts: it must be asked (prediction.h)
  LoraSet loras;
  std::vector<std::filesystem::path> files;  // all that was opened
  std::vector<std::string> notes;            // what was taken from where without being told to
};

/// The folders of a diffusers model that hold networks.
std::vector<std::string> component_folders();

/// Finds every part in the order: what `paths` names, the model itself, the model folders. A name that is no
/// path is looked for in the model folders. Throws Error that names what is missing or does not fit, and what
/// to do.
ModelParts find_model_parts(const ModelPaths& paths);

}  // namespace patina::diffusion
