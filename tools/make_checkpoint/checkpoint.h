// Writes models of random weights as the tools of the field lay them out. A value depends on the seed and the
// tensor's name in diffusers alone, so all layouts of one model hold the same weights.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "make_checkpoint/configs.h"
#include "patina/nn/safetensors.h"

namespace patina::make_checkpoint {

struct Model {
  Configs configs;
  nn::ElementType type = nn::ElementType::kF32;
  bool mixed = false;  // every second tensor is F32 whatever `type` says
  bool empty = false;  // zeros that take no place on disk: for shapes alone
  uint64_t seed = 1;   // ControlNets add one for "normal"
};

/// Networks of a single file beside the U-Net.
struct SingleFileOptions {
  bool vae = true, text_encoder = true;
  bool leftovers = false;  // what training leaves in a file: schedules, averages, position ids
};
/// LDM's names: model.diffusion_model., first_stage_model., cond_stage_model.
void write_single_file(const std::filesystem::path& path, const Model& model,
                       const SingleFileOptions& options = {});

struct FolderOptions {
  std::string variant = {};              // "fp16": diffusion_pytorch_model.fp16.safetensors
  int num_shards = 1;                    // of the U-Net; more than one come with an index
  std::filesystem::path tokenizer = {};  // copied into the folder; empty: none
};
/// A diffusers folder with two ControlNets.
void write_diffusers_folder(const std::filesystem::path& folder, const Model& model,
                            const FolderOptions& options = {});

enum class Layout { kDiffusers, kLdm, kLdmPrefixed };
/// kLdm: cldm's names; kLdmPrefixed: with control_model. before them.
void write_controlnet(const std::filesystem::path& path, const Model& model, Layout layout, bool normal);
/// kLdmPrefixed: with first_stage_model. before the names.
void write_vae(const std::filesystem::path& path, const Model& model, Layout layout);

enum class LoraNaming { kKohya, kKohyaLdm, kPeft, kDiffusersOld, kDiffusersProcessor };
struct LoraOptions {
  LoraNaming naming = LoraNaming::kKohya;
  int64_t rank = 4;
  double alpha = 2;           // kohya only; the others have none: alpha = rank
  bool convolutions = false;  // LoCon: resnets' 3×3 too
  bool cores = false;         // the convolutions with a Tucker core
  bool text_encoder = true;
};
/// Of every projection of the U-Net's attention, and of the text encoder's.
void write_lora(const std::filesystem::path& path, const Model& model, const LoraOptions& options = {});

}  // namespace patina::make_checkpoint
