#include "patina/diffusion/files/tensor_table.h"

#include <array>

#include "patina/base/error.h"

namespace patina::diffusion {
namespace {

/// One way in which files store a network.
struct Scheme {
  Network network;
  Naming naming;
  const char* prefix;  // of all its names
  const char* marker;  // what follows the prefix in some name, and in no other network's
};
constexpr std::array kSchemes{
    Scheme{Network::kUNet, Naming::kLdm, "model.diffusion_model.", "output_blocks."},
    Scheme{Network::kUNet, Naming::kDiffusers, "", "up_blocks."},
    Scheme{Network::kUNet, Naming::kLdm, "", "output_blocks."},
    Scheme{Network::kVae, Naming::kLdm, "first_stage_model.", "decoder.up."},
    Scheme{Network::kVae, Naming::kDiffusers, "", "decoder.up_blocks."},
    Scheme{Network::kVae, Naming::kLdm, "", "decoder.up."},
    Scheme{Network::kTextEncoder, Naming::kDiffusers, "cond_stage_model.transformer.", "text_model."},
    Scheme{Network::kTextEncoder, Naming::kBareClip, "cond_stage_model.transformer.", "encoder.layers."},
    Scheme{Network::kTextEncoder, Naming::kOpenClip, "cond_stage_model.model.", "transformer.resblocks."},
    Scheme{Network::kTextEncoder, Naming::kDiffusers, "", "text_model.encoder."},
    Scheme{Network::kTextEncoder, Naming::kOpenClip, "", "transformer.resblocks."},
    Scheme{Network::kControlNet, Naming::kLdm, "control_model.", "input_hint_block."},
    Scheme{Network::kControlNet, Naming::kDiffusers, "", "controlnet_cond_embedding."},
    Scheme{Network::kControlNet, Naming::kLdm, "", "input_hint_block."}};

/// How many of "<prefix>0.", "<prefix>1.", … there are.
int64_t count_numbered(const HasPrefix& has, const std::string& prefix) {
  int64_t count = 0;
  while (has(prefix + std::to_string(count) + ".")) ++count;
  return count;
}

/// The table of names that fits what the file holds.
NameMap names_for(const Scheme& scheme, const HasPrefix& has) {
  if (scheme.naming == Naming::kOpenClip) {
    // SD 2.x was trained on the last layer but one [Rombach2022's second release]: the last is never run.
    return openclip_names(count_numbered(has, "transformer.resblocks.") - 1);
  }
  if (scheme.naming != Naming::kLdm) return {};
  switch (scheme.network) {
    case Network::kVae:
      return vae_names(count_numbered(has, "encoder.down."), count_numbered(has, "encoder.down.0.block."));
    case Network::kControlNet: {
      // Layer k of the hint's encoder has the number 2k; two of every level, one before and one behind.
      int64_t num_layers = 0;
      while (has("input_hint_block." + std::to_string(2 * num_layers) + ".")) ++num_layers;
      return controlnet_names(levels_of_ldm(has), num_layers / 2);
    }
    default:
      return unet_names(levels_of_ldm(has));
  }
}

/// Leftovers of training and layers that are never run: in the network's place, but no part of it.
bool is_leftover(const Scheme& scheme, const std::string& name, const std::string& unused_layer) {
  if (scheme.network == Network::kVae) return name.starts_with("loss.") || name.starts_with("model_ema.");
  return scheme.naming == Naming::kOpenClip && name.starts_with(unused_layer);
}

/// The rows of a fused projection as three tensors; false if `name` is none.
bool add_fused(TensorTable& table, const std::string& name, const StoredTensor& tensor) {
  for (const FusedProjection& fused : kFusedProjections) {
    if (!name.ends_with(fused.ldm)) continue;
    const std::optional<std::string> layer =
        table.names.to_diffusers(name.substr(0, name.size() - std::string_view(fused.ldm).size() - 1));
    if (!layer || tensor.entry.shape.empty() || tensor.entry.shape[0] % 3 != 0) return false;
    for (size_t part = 0; part < 3; ++part) {
      StoredTensor rows = tensor;
      rows.entry.shape[0] /= 3;
      const size_t bytes = rows.entry.bytes.size() / 3;
      rows.entry.bytes = rows.entry.bytes.subspan(part * bytes, bytes);
      table.tensors.emplace(*layer + "." + fused.diffusers[part], rows);
    }
    return true;
  }
  return false;
}

}  // namespace

const char* name_of(Network network) {
  switch (network) {
    case Network::kUNet:
      return "U-Net";
    case Network::kVae:
      return "VAE";
    case Network::kTextEncoder:
      return "text encoder";
    case Network::kControlNet:
      break;
  }
  return "ControlNet";
}

bool TensorTable::has_prefix(std::string_view prefix) const {
  const auto found = tensors.lower_bound(prefix);
  return found != tensors.end() && found->first.starts_with(prefix);
}

std::string TensorTable::stored_name(const std::string& name) const {
  std::string stored = name;
  if (const auto found = tensors.find(name); found != tensors.end()) return found->second.entry.name;
  if (naming == Naming::kBareClip && name.starts_with("text_model."))
    stored = name.substr(std::string_view("text_model.").size());
  for (const FusedProjection& fused : kFusedProjections) {
    for (const std::string part : fused.diffusers) {
      if (naming != Naming::kOpenClip || !name.ends_with(part)) continue;
      const auto layer = names.to_ldm(name.substr(0, name.size() - part.size() - 1));
      if (layer) return stored_prefix + *layer + "." + fused.ldm;
    }
  }
  return stored_prefix + names.to_ldm(name).value_or(stored);
}

std::optional<TensorTable> find_network(const WeightFiles& files, Network network) {
  for (const Scheme& scheme : kSchemes) {
    const std::string prefix = scheme.prefix;
    if (scheme.network != network || !files.has_prefix(prefix + scheme.marker)) continue;
    const HasPrefix has = [&](const std::string& name) { return files.has_prefix(prefix + name); };
    TensorTable table{files.where, network, scheme.naming, prefix, {}, {}, names_for(scheme, has)};
    const std::string unused_layer =
        "transformer.resblocks." + std::to_string(count_numbered(has, "transformer.resblocks.") - 1) + ".";

    for (auto at = files.tensors.lower_bound(prefix);
         at != files.tensors.end() && at->first.starts_with(prefix); ++at) {
      const std::string name = at->first.substr(prefix.size());
      if (is_leftover(scheme, name, unused_layer)) continue;
      if (scheme.naming == Naming::kDiffusers || scheme.naming == Naming::kBareClip) {
        table.tensors.emplace(scheme.naming == Naming::kBareClip ? "text_model." + name : name, at->second);
      } else if (scheme.naming == Naming::kOpenClip && add_fused(table, name, at->second)) {
        continue;
      } else if (const auto translated = table.names.to_diffusers(name)) {
        table.tensors.emplace(*translated, at->second);
      } else {
        table.unknown.push_back(name);
      }
    }
    return table;
  }
  return std::nullopt;
}

int64_t size_of(const TensorTable& table, const std::string& name, size_t axis) {
  const auto found = table.tensors.find(name);
  if (found == table.tensors.end())
    throw Error(ErrorCode::kFormat, table.where.string(),
                "lacks the tensor " + table.stored_name(name) + ", which tells a size of the " +
                    name_of(table.network) + "; the file is incomplete or of another kind of model");
  const nn::TensorEntry& entry = found->second.entry;
  if (axis >= entry.shape.size())
    throw Error(ErrorCode::kFormat, table.where.string(),
                "tensor " + printable(entry.name, 80) + " has the shape " + nn::shape_text(entry.shape) +
                    ", expected at least " + std::to_string(axis + 1) + " axes");
  return entry.shape[axis];
}

}  // namespace patina::diffusion
