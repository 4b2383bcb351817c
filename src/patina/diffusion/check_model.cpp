#include "patina/diffusion/check_model.h"

#include <cstdio>
#include <cstring>

#include "patina/base/error.h"
#include "patina/diffusion/control_kinds.h"
#include "patina/diffusion/files/embedding.h"
#include "patina/diffusion/list_models.h"
#include "patina/diffusion/networks/controlnet.h"
#include "patina/diffusion/networks/dry_run.h"
#include "patina/diffusion/networks/text_encoder.h"
#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/networks/vae.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

std::string formatted(const char* format, auto... values) {
  char text[400];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

/// Elements whose exponent is all ones: infinities and NaN.
template <class Bits>
size_t count_not_finite(std::span<const uint8_t> bytes, Bits exponent) {
  size_t count = 0;
  for (size_t at = 0; at + sizeof(Bits) <= bytes.size(); at += sizeof(Bits)) {
    Bits bits;
    std::memcpy(&bits, bytes.data() + at, sizeof bits);
    count += (bits & exponent) == exponent;
  }
  return count;
}

size_t count_not_finite(const nn::TensorEntry& entry) {
  switch (entry.type) {
    case nn::ElementType::kF16:
      return count_not_finite<uint16_t>(entry.bytes, 0x7C00);
    case nn::ElementType::kBF16:
      return count_not_finite<uint16_t>(entry.bytes, 0x7F80);
    case nn::ElementType::kF32:
      return count_not_finite<uint32_t>(entry.bytes, 0x7F800000);
    case nn::ElementType::kF64:
      return count_not_finite<uint64_t>(entry.bytes, 0x7FF0000000000000);
    default:
      return 0;
  }
}

const char* names_text(const TensorTable& table) {
  if (table.network == Network::kTextEncoder && table.naming != Naming::kOpenClip) return "CLIP's names";
  switch (table.naming) {
    case Naming::kLdm:
      return "LDM's names";
    case Naming::kOpenClip:
      return "OpenCLIP's names";
    default:
      return "diffusers' names";
  }
}

/// Checks a network and describes it in one line.
template <class Config>
std::string checked(const NetworkPart<Config>& part) {
  check_tensors(part);
  int64_t parameters = 0;
  for (const auto& [name, tensor] : part.table.tensors) parameters += tensor.entry.num_elements();
  return formatted("  %-13s %zu tensors, %.1f M parameters, %s\n", name_of(part.table.network),
                   part.table.tensors.size(), static_cast<double>(parameters) * 1e-6, names_text(part.table));
}

std::string check_model_folder(const fs::path& folder) {
  std::string text = checked(open_unet(folder / "unet"));
  if (fs::is_directory(folder / "text_encoder")) text += checked(open_text_encoder(folder / "text_encoder"));
  if (fs::is_directory(folder / "vae")) text += checked(open_vae(folder / "vae"));
  for (const ControlKind& kind : kControlKinds) {
    if (fs::is_directory(folder / kind.component)) text += checked(open_controlnet(folder / kind.component));
  }
  for (const std::string& name : component_folders()) {
    if (fs::is_directory(folder / name)) check_values(open_weight_files(folder / name));
  }
  return text;
}

std::string check_weights(const fs::path& path, FileKind kind) {
  const WeightFiles files = open_weight_files(path);
  std::string text;
  switch (kind) {
    case FileKind::kCheckpoint:
    case FileKind::kUNet:
      text = checked(open_unet(path));
      if (find_network(files, Network::kTextEncoder)) text += checked(open_text_encoder(path));
      if (find_network(files, Network::kVae)) text += checked(open_vae(path));
      break;
    case FileKind::kVae:
      text = checked(open_vae(path));
      break;
    case FileKind::kTextEncoder:
      text = checked(open_text_encoder(path));
      break;
    case FileKind::kControlNet:
      text = checked(open_controlnet(path));
      break;
    case FileKind::kLora:
      text = formatted("  %zu tensors; whether they fit a model is told when both are given\n",
                       files.tensors.size());
      break;
    case FileKind::kEmbedding: {
      const int64_t width = files.tensors.begin()->second.entry.shape.back();
      for (const LearnedWord& word : read_embedding(path, width))
        text += formatted("  word '%s', %lld vectors of %lld\n", printable(word.word, 80).c_str(),
                          static_cast<long long>(word.count), static_cast<long long>(width));
      break;
    }
    case FileKind::kOther:
      break;
  }
  check_values(files);
  return text;
}

}  // namespace

void check_tensors(const UNetPart& part) {
  check_tensors<UNet>(part);
}
void check_tensors(const VaePart& part) {
  check_tensors<Vae>(part);
}
void check_tensors(const TextEncoderPart& part) {
  check_tensors<TextEncoder>(part);
}
void check_tensors(const ControlNetPart& part) {
  check_tensors<ControlNet>(part);
}

void check_values(const WeightFiles& files) {
  std::string faults;
  size_t num_faults = 0;
  for (const auto& [name, tensor] : files.tensors) {
    const size_t count = count_not_finite(tensor.entry);
    if (count == 0) continue;
    if (++num_faults <= 8)
      faults += (faults.empty() ? "" : ", ") + printable(name, 100) + " (" + std::to_string(count) + " of " +
                std::to_string(tensor.entry.num_elements()) + ")";
  }
  if (num_faults > 0)
    throw Error(ErrorCode::kFormat, files.where.string(),
                std::to_string(num_faults) + " tensors hold infinities or NaN: " + faults);
}

std::string check_path(const fs::path& path) {
  if (!fs::exists(path)) throw Error(ErrorCode::kNotFound, path.string(), "does not exist");
  nn::refuse_pickle_name(path);
  const ModelEntry entry = describe_entry(path);
  if (!entry.refusal.empty()) throw Error(ErrorCode::kUnsupported, path.string(), entry.refusal);
  std::string text =
      path.string() + "\n  " + (entry.is_model_folder ? "diffusers model" : name_of(entry.kind));
  if (entry.family) text += std::string(", ") + name_of(*entry.family);
  text += ", " + entry.precision + formatted(", %.1f MB\n", static_cast<double>(entry.bytes) * 1e-6);
  text += entry.is_model_folder ? check_model_folder(path) : check_weights(path, entry.kind);
  for (const std::string& lack : entry.lacks) text += "  needs a " + lack + " beside it\n";
  return text + "  All tensors are there, of the right shape, and finite.\n";
}

void check_model(const ModelParts& parts, std::optional<Scheduler> scheduler) {
  if (scheduler) {
    if (const auto refusal = choose_scheduler(parts.scheduler, *scheduler).refusal) throw *refusal;
  }
  check_tensors(parts.unet);
  for (const TextPart& text : parts.texts) check_tensors(text.encoder);
  check_tensors(parts.vae);
  for (const ControlNetPart& controlnet : parts.controlnets) check_tensors(controlnet);
}

}  // namespace patina::diffusion
