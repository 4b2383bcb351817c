#include "patina/diffusion/list_models.h"

#include <algorithm>
#include <map>

#include "patina/base/error.h"
#include "patina/base/text.h"
#include "patina/diffusion/control_kinds.h"
#include "patina/diffusion/files/infer_config.h"
#include "patina/diffusion/files/network_part.h"
#include "patina/diffusion/files/search_folders.h"
#include "patina/diffusion/text/find_tokenizer.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

std::string short_type(nn::ElementType type) {
  return lowered(std::string(nn::name_of(type)));
}

std::optional<Family> family_of_entry(const WeightFiles& files, FileKind kind) {
  switch (kind) {
    case FileKind::kCheckpoint:
    case FileKind::kUNet:
      return family_of(infer_unet_config(find_network(files, Network::kUNet).value()));
    case FileKind::kControlNet:
      return family_of(infer_controlnet_config(find_network(files, Network::kControlNet).value()).unet);
    case FileKind::kTextEncoder:
      return family_of_text_width(
          infer_text_encoder_config(find_network(files, Network::kTextEncoder).value()).hidden_size);
    case FileKind::kLora:
      // The matrices that meet the text's vectors: of cross-attention's keys.
      for (const auto& [name, tensor] : files.tensors) {
        const bool meets_text =
            name.find("attn2") != std::string::npos && name.find("to_k") != std::string::npos;
        const bool is_down =
            name.find("down.weight") != std::string::npos || name.find("lora_A") != std::string::npos;
        if (meets_text && is_down && tensor.entry.shape.size() >= 2)
          return family_of_text_width(tensor.entry.shape[1]);
      }
      return std::nullopt;
    case FileKind::kEmbedding:
      return family_of_text_width(files.tensors.begin()->second.entry.shape.back());
    default:
      return std::nullopt;
  }
}

void describe_model_folder(ModelEntry& entry) {
  entry.is_model_folder = true;
  entry.kind = FileKind::kCheckpoint;
  const UNetPart unet = open_unet(entry.path / "unet");
  entry.family = family_of(unet.config);
  for (const char* name : {"unet", "text_encoder", "vae"}) {
    if (!fs::is_directory(entry.path / name)) {
      entry.lacks.push_back(name == std::string("vae") ? "VAE" : "text encoder");
      continue;
    }
    const WeightFiles files = open_weight_files(entry.path / name);
    for (const auto& file : files.files) entry.bytes += fs::file_size(file->path());
    if (entry.precision.empty()) entry.precision = precision_of(files);
  }
  if (!fs::is_directory(entry.path / "tokenizer")) entry.lacks.push_back("tokenizer");
}

void describe_weights(ModelEntry& entry) {
  const WeightFiles files = open_weight_files(entry.path);
  for (const auto& file : files.files) entry.bytes += fs::file_size(file->path());
  entry.precision = precision_of(files);
  const Recognised recognised = recognise(files);
  entry.kind = recognised.kind;
  entry.refusal = recognised.refusal;
  if (!entry.refusal.empty()) return;
  entry.family = family_of_entry(files, entry.kind);
  if (entry.kind == FileKind::kCheckpoint || entry.kind == FileKind::kUNet) {
    if (!find_network(files, Network::kVae)) entry.lacks.push_back("VAE");
    if (!find_network(files, Network::kTextEncoder)) entry.lacks.push_back("text encoder");
  }
}

}  // namespace

std::string precision_of(const WeightFiles& files) {
  std::map<nn::ElementType, size_t> bytes;
  for (const auto& [name, tensor] : files.tensors) {
    const nn::ElementType type = tensor.entry.type;
    // Ids and counters say nothing about the precision of the weights.
    if (type != nn::ElementType::kI64 && type != nn::ElementType::kI32)
      bytes[type] += tensor.entry.bytes.size();
  }
  std::vector<std::pair<size_t, nn::ElementType>> sorted;
  for (const auto& [type, size] : bytes) sorted.emplace_back(size, type);
  std::sort(sorted.rbegin(), sorted.rend());
  std::string text;
  for (const auto& [size, type] : sorted) {
    if (!text.empty()) text += ' ';
    text += short_type(type);
  }
  return text;
}

ModelEntry describe_entry(const fs::path& path) {
  ModelEntry entry;
  entry.path = path;
  try {
    if (is_model_folder(path))
      describe_model_folder(entry);
    else
      describe_weights(entry);
  } catch (const Error& error) {
    entry.refusal = error.message();
  }
  return entry;
}

std::vector<ModelEntry> list_models(std::span<const fs::path> folders) {
  const FoundFiles found = search_folders(folders);
  std::vector<ModelEntry> entries;
  for (const auto* paths : {&found.models, &found.weights, &found.pickles}) {
    for (const fs::path& path : *paths) {
      entries.push_back(describe_entry(path));
      std::error_code ignored;
      if (paths == &found.pickles) entries.back().bytes = fs::file_size(path, ignored);
    }
  }
  return entries;
}

std::vector<std::string> what_is_missing(std::span<const ModelEntry> entries,
                                         std::span<const fs::path> folders) {
  std::vector<std::string> missing;
  for (const FamilyTraits& traits : kFamilies) {
    const auto any = [&](auto test) {
      return std::any_of(entries.begin(), entries.end(), [&](const ModelEntry& entry) {
        return entry.refusal.empty() && entry.family == traits.family && test(entry);
      });
    };
    if (!any([](const ModelEntry& e) { return e.kind == FileKind::kCheckpoint; })) continue;
    for (const ControlKind& control : kControlKinds) {
      const bool found = any([&](const ModelEntry& e) {
        return e.kind == FileKind::kControlNet &&
               lowered(e.path.filename().string()).find(control.name) != std::string::npos;
      });
      const bool inside = any(
          [&](const ModelEntry& e) { return e.is_model_folder && fs::exists(e.path / control.component); });
      if (!found && !inside)
        missing.push_back(std::string("A ControlNet for ") + control.name + " of " + traits.name +
                          " (a file whose name holds '" + control.name + "').");
    }
  }
  // Single files of one vocabulary need one tokenizer together.
  for (const ModelEntry& entry : entries) {
    const bool has_text =
        std::find(entry.lacks.begin(), entry.lacks.end(), "text encoder") == entry.lacks.end();
    if (entry.kind != FileKind::kCheckpoint || entry.is_model_folder || !entry.refusal.empty() || !has_text)
      continue;
    const int64_t vocabulary = open_text_encoder(entry.path).config.vocab_size;
    try {
      find_tokenizer({{}, entry.path, {folders.begin(), folders.end()}, vocabulary});
    } catch (const Error&) {
      missing.push_back(
          "A tokenizer for the single files: CLIP's merges.txt and vocab.json, as in ComfyUI's "
          "comfy/sd1_tokenizer or any diffusers model.");
      break;
    }
  }
  return missing;
}

}  // namespace patina::diffusion
