// What models, ControlNets, LoRAs and the like lie in some folders, whether patina can use them, and what it
// lacks beside them. What a file is its tensors tell, so no folder needs a certain name. No Torch here.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "patina/diffusion/files/families.h"
#include "patina/diffusion/files/recognise.h"

namespace patina::diffusion {

/// One line of `patina models`.
struct ModelEntry {
  std::filesystem::path path;
  FileKind kind = FileKind::kOther;
  bool is_model_folder = false;  // a whole diffusers model
  std::optional<Family> family;  // nullopt: not told by the file
  std::string precision;         // "f16", "f32 f16"
  uintmax_t bytes = 0;
  std::string refusal;             // why patina cannot use it; empty: it can
  std::vector<std::string> lacks;  // networks that the user must give beside it: "VAE", "text encoder"
};
/// Reads the headers. Never throws for a broken file: the fault becomes its refusal.
ModelEntry describe_entry(const std::filesystem::path& path);
std::vector<ModelEntry> list_models(std::span<const std::filesystem::path> folders);

/// What the checkpoints among the entries still need before patina can run them, one sentence each.
std::vector<std::string> what_is_missing(std::span<const ModelEntry> entries,
                                         std::span<const std::filesystem::path> folders);

/// The elements' types in the files, the one with most bytes first.
std::string precision_of(const WeightFiles& files);

}  // namespace patina::diffusion
