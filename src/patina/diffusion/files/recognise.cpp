#include "patina/diffusion/files/recognise.h"

#include <algorithm>
#include <array>

#include "patina/base/error.h"
#include "patina/diffusion/files/families.h"

namespace patina::diffusion {
namespace {

/// A model that patina refuses: a prefix of tensor names that no other kind has.
struct Foreign {
  FileKind kind;
  const char* prefix;
  const char* what;
};
// The first that fits names the file, so what is more particular stands first.
constexpr std::array kForeign{
    Foreign{FileKind::kCheckpoint, "model.diffusion_model.joint_blocks.", "a Stable Diffusion 3 checkpoint"},
    Foreign{FileKind::kUNet, "joint_blocks.", "a Stable Diffusion 3 transformer"},
    Foreign{FileKind::kCheckpoint, "model.diffusion_model.double_blocks.", "a Flux checkpoint"},
    Foreign{FileKind::kUNet, "double_blocks.", "a Flux transformer"},
    Foreign{FileKind::kUNet, "single_transformer_blocks.", "a Flux transformer"},
    Foreign{FileKind::kUNet, "transformer_blocks.0.attn.add_q_proj.", "a Stable Diffusion 3 transformer"},
    Foreign{FileKind::kCheckpoint, "conditioner.embedders.1.", "a Stable Diffusion XL checkpoint"},
    Foreign{FileKind::kCheckpoint, "conditioner.embedders.0.model.",
            "a checkpoint of Stable Diffusion XL's refiner"},
    Foreign{FileKind::kCheckpoint, "embedder.model.visual.", "a Stable unCLIP checkpoint"},
    Foreign{FileKind::kCheckpoint, "model.diffusion_model.label_emb.", "a Stable Diffusion XL checkpoint"},
    Foreign{FileKind::kUNet, "label_emb.", "a U-Net of Stable Diffusion XL"},
    Foreign{FileKind::kControlNet, "control_model.label_emb.", "a ControlNet of Stable Diffusion XL"},
    Foreign{FileKind::kUNet, "add_embedding.", "a U-Net or ControlNet of Stable Diffusion XL"},
    Foreign{FileKind::kControlNet, "lora_controlnet", "a control LoRA, which is a difference to a U-Net"},
    Foreign{FileKind::kControlNet, "body.0.block1.", "a T2I adapter"},
    Foreign{FileKind::kControlNet, "adapter.body.", "a T2I adapter"},
    Foreign{FileKind::kOther, "image_proj.", "an IP-Adapter"},
    Foreign{FileKind::kLora, "lora_te1_", "a LoRA for Stable Diffusion XL"},
    Foreign{FileKind::kLora, "lora_te2_", "a LoRA for Stable Diffusion XL"},
    Foreign{FileKind::kLora, "text_encoder_2.", "a LoRA for Stable Diffusion XL"},
    Foreign{FileKind::kLora, "lora_unet_double_blocks_", "a LoRA for Flux"},
    Foreign{FileKind::kLora, "transformer.single_transformer_blocks.", "a LoRA for Flux"},
    Foreign{FileKind::kLora, "transformer.transformer_blocks.", "a LoRA for Stable Diffusion 3 or Flux"},
    Foreign{FileKind::kLora, "lora_unet_joint_blocks_", "a LoRA for Stable Diffusion 3"},
    Foreign{FileKind::kEmbedding, "clip_g", "an embedding for Stable Diffusion XL"}};

/// Adapters that are no sum of low-rank products (LyCORIS and others), by what a tensor's name ends in.
struct Adapter {
  const char* suffix;
  const char* what;
};
constexpr std::array kForeignAdapters{
    Adapter{".hada_w1_a", "a LyCORIS LoHa, a product of Hadamard factors"},
    Adapter{".lokr_w1", "a LyCORIS LoKr, a Kronecker product"},
    Adapter{".lokr_w1_a", "a LyCORIS LoKr, a Kronecker product"},
    Adapter{".oft_blocks", "an OFT adapter, a rotation of the weights"},
    Adapter{".oft_diag", "an OFT adapter, a rotation of the weights"},
    Adapter{".dora_scale", "a DoRA, which rescales the weights"},
    Adapter{".lora_magnitude_vector", "a DoRA, which rescales the weights"},
    Adapter{".lora_magnitude_vector.weight", "a DoRA, which rescales the weights"},
    Adapter{".on_input", "a LyCORIS IA3, which scales activations"},
    Adapter{".b1.weight", "a LyCORIS GLoRA"},
    Adapter{".diff", "a LyCORIS Full or Norm adapter, which holds whole differences"},
    Adapter{".diff_b", "a LyCORIS Full or Norm adapter, which holds whole differences"}};

bool any_name(const WeightFiles& files, const auto& test) {
  return std::any_of(files.tensors.begin(), files.tensors.end(),
                     [&](const auto& named) { return test(named.first); });
}
bool any_contains(const WeightFiles& files, std::string_view part) {
  return any_name(files, [&](const std::string& name) { return name.find(part) != std::string::npos; });
}

bool is_lora(const WeightFiles& files) {
  for (const char* part :
       {".lora_down.", ".lora_A.", ".lora.down.", "_lora.down.", ".lora_linear_layer.down.", ".lora_B."}) {
    if (any_contains(files, part)) return true;
  }
  return false;
}

/// Embeddings are one to a few tensors of some vectors: A1111's has a fixed name, diffusers' that of its
/// word.
bool is_embedding(const WeightFiles& files) {
  if (files.tensors.empty() || files.tensors.size() > 4) return false;
  if (files.tensors.contains("emb_params") || files.tensors.contains("clip_l")) return true;
  const auto few_vectors = [](const auto& named) {
    const std::vector<int64_t>& shape = named.second.entry.shape;
    return (shape.size() == 1 || (shape.size() == 2 && shape[0] <= 75)) &&
           named.first.find('.') == std::string::npos;
  };
  return std::all_of(files.tensors.begin(), files.tensors.end(), few_vectors);
}

FileKind kind_of(const WeightFiles& files) {
  if (files.has_prefix("model.diffusion_model.")) return FileKind::kCheckpoint;
  if (is_lora(files)) return FileKind::kLora;
  for (const char* prefix : {"control_model.", "input_hint_block.", "controlnet_cond_embedding."}) {
    if (files.has_prefix(prefix)) return FileKind::kControlNet;
  }
  for (const char* prefix : {"output_blocks.", "up_blocks."}) {
    if (files.has_prefix(prefix)) return FileKind::kUNet;
  }
  for (const char* prefix : {"first_stage_model.", "decoder.up.", "decoder.up_blocks."}) {
    if (files.has_prefix(prefix)) return FileKind::kVae;
  }
  for (const char* prefix : {"cond_stage_model.", "text_model.encoder.", "transformer.resblocks."}) {
    if (files.has_prefix(prefix)) return FileKind::kTextEncoder;
  }
  return is_embedding(files) ? FileKind::kEmbedding : FileKind::kOther;
}

std::string refused(const std::string& what) {
  return "is " + what + "; patina runs " + kFamilyNames;
}

}  // namespace

const char* name_of(FileKind kind) {
  switch (kind) {
    case FileKind::kCheckpoint:
      return "checkpoint";
    case FileKind::kUNet:
      return "U-Net";
    case FileKind::kVae:
      return "VAE";
    case FileKind::kTextEncoder:
      return "text encoder";
    case FileKind::kControlNet:
      return "ControlNet";
    case FileKind::kLora:
      return "LoRA";
    case FileKind::kEmbedding:
      return "embedding";
    case FileKind::kOther:
      break;
  }
  return "file of an unknown kind";
}

Recognised recognise(const WeightFiles& files) {
  for (const Adapter& adapter : kForeignAdapters) {
    if (any_name(files, [&](const std::string& name) { return name.ends_with(adapter.suffix); }))
      return {FileKind::kLora,
              "is " + std::string(adapter.what) +
                  ", which patina does not merge; it merges LoRA and LoCon (lora_down, lora_up)"};
  }
  for (const Foreign& foreign : kForeign) {
    if (files.has_prefix(foreign.prefix)) return {foreign.kind, refused(foreign.what)};
  }
  const FileKind kind = kind_of(files);
  if (kind == FileKind::kOther)
    return {kind, "holds no network that patina knows (its first tensor is '" +
                      (files.tensors.empty() ? "" : printable(files.tensors.begin()->first, 80)) +
                      "'); expected a checkpoint, ControlNet, VAE, LoRA or embedding of " + kFamilyNames};
  return {kind, ""};
}

void require_kind(const WeightFiles& files, FileKind expected) {
  const Recognised found = recognise(files);
  if (!found.refusal.empty()) throw Error(ErrorCode::kUnsupported, files.where.string(), found.refusal);
  // A checkpoint holds U-Net, VAE and text encoder, and a U-Net alone may stand where a checkpoint is asked
  // for.
  const bool in_checkpoint =
      found.kind == FileKind::kCheckpoint &&
      (expected == FileKind::kUNet || expected == FileKind::kVae || expected == FileKind::kTextEncoder ||
       (expected == FileKind::kControlNet && files.has_prefix("control_model.")));
  const bool alone = found.kind == FileKind::kUNet && expected == FileKind::kCheckpoint;
  if (found.kind != expected && !in_checkpoint && !alone)
    throw Error(ErrorCode::kUsage, files.where.string(),
                "is a " + std::string(name_of(found.kind)) + ", expected a " + name_of(expected));
}

}  // namespace patina::diffusion
