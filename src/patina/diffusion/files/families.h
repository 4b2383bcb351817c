// The families of models that patina runs: all that tells one from the other and that a file's tensors do not
// say, one row a family. Recognition of files, sizes told from shapes, folders, names and error texts ask
// this table; a new family starts with a row here (and leaves the list of refused kinds in recognise.cpp). No
// Torch here.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "patina/diffusion/files/config.h"
#include "patina/diffusion/files/tensor_table.h"

namespace patina::diffusion {

enum class Family { kSd1, kSd2 };

struct FamilyTraits {
  Family family;
  const char* name;
  bool linear_projection;         // proj_in and proj_out are linear layers, not 1×1 convolutions
  int64_t num_heads;              // at every level of the U-Net; 0: heads of `head_width` channels
  int64_t head_width;             // 0: see num_heads
  int64_t text_width;             // of the published models' text tokens; of LoRAs and embeddings too
  Naming text_naming;             // of the text encoder in single files
  TextActivation activation;      // of the text encoder
  std::optional<int64_t> pad_id;  // of a tokenizer that does not come with the model; nullopt: its own
  bool prediction_varies;         // models that predict v are as common as those that predict noise
};
inline constexpr std::array<FamilyTraits, 2> kFamilies{{
    {Family::kSd1, "Stable Diffusion 1.x", false, 8, 0, 768, Naming::kDiffusers, TextActivation::kQuickGelu,
     std::nullopt, false},
    // OpenCLIP's ViT-H pads with zeros, whatever the tokenizer's files say.
    {Family::kSd2, "Stable Diffusion 2.x", true, 0, 64, 1024, Naming::kOpenClip, TextActivation::kGelu, 0,
     true},
}};
/// For messages: what patina runs.
inline constexpr const char* kFamilyNames = "Stable Diffusion 1.x and 2.x";
/// What `_class_name` of a model_index.json may begin with.
inline constexpr std::array<std::string_view, 4> kPipelineClasses{
    "StableDiffusionPipeline", "StableDiffusionImg2Img", "StableDiffusionControlNet", "Patina"};

const FamilyTraits& traits_of(Family family);
const char* name_of(Family family);

/// Every fine-tune keeps its family's projections.
Family family_of(const UNetConfig& config);
/// By the names of its tensors, else by its width; SD 1.x if neither tells.
Family family_of_text_encoder(Naming naming, int64_t width);
/// By the width of the text that a file reads or gives; nullopt: of neither.
std::optional<Family> family_of_text_width(int64_t width);

}  // namespace patina::diffusion
