// Whether the tensors of weight files are those of the networks they should be, by name, shape, type and
// value, without loading them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "patina/diffusion/files/network_part.h"
#include "patina/diffusion/model_parts.h"

namespace patina::diffusion {

/// Each throws Error naming every tensor that is missing, too much or misshapen, or its type.
void check_tensors(const UNetPart& part);
void check_tensors(const VaePart& part);
void check_tensors(const TextEncoderPart& part);
void check_tensors(const ControlNetPart& part);

/// All networks of a model; and throws Error that names a setting of `scheduler`, if one is given, that
/// patina lacks.
void check_model(const ModelParts& parts, std::optional<Scheduler> scheduler = std::nullopt);

/// Throws Error{kFormat} naming the tensors that hold infinities or NaN. Reads all of the files.
void check_values(const WeightFiles& files);

/// What a checkpoint, ControlNet, VAE, LoRA, embedding or diffusers folder is, in a few lines, after checking
/// all of its tensors. Throws Error.
std::string check_path(const std::filesystem::path& path);

}  // namespace patina::diffusion
