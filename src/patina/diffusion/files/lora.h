// Low-rank changes of weights [Hu2022], W + weight · (alpha / rank) · B A: whose tensors of a LoRA file
// belong to which weights of a model. Read are kohya's names (lora_unet_…, lora_te_…, LoCon's convolutions
// and their cores), ComfyUI's (diffusion_model.…), diffusers' and PEFT's, old and new. No Torch here.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "patina/diffusion/files/network_part.h"
#include "patina/diffusion/options.h"

namespace patina::diffusion {

/// One product for one weight of shape [out, …].
struct LoraDelta {
  StoredTensor down;                // A [rank, …]
  StoredTensor up;                  // B [out, rank], maybe with trailing ones
  std::optional<StoredTensor> mid;  // a core [rank, rank, k, k] between them (LoCon's Tucker form)
  double scale = 1;                 // weight · alpha / rank
};
/// By the weight's name as diffusers has it.
using LoraDeltas = std::map<std::string, std::vector<LoraDelta>, std::less<>>;

struct LoraSet {
  LoraDeltas unet;
  std::vector<LoraDeltas> text_encoders;  // as many as the model has
  std::vector<std::filesystem::path> files;
};

/// All LoRAs in the order given. Throws Error that names the file and tensor: of another kind of adapter, of
/// another model, without its counterpart, misshapen.
LoraSet match_loras(std::span<const LoraChoice> choices, const UNetPart& unet,
                    std::span<const TensorTable* const> text_encoders);

}  // namespace patina::diffusion
