// The tensors of one network under diffusers' names, wherever and under whatever names they are stored: in a
// diffusers folder, in a single-file checkpoint beside other networks, in LDM's, OpenCLIP's or cldm's naming.
// No Torch here.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "patina/diffusion/files/ldm_names.h"
#include "patina/diffusion/files/weight_files.h"

namespace patina::diffusion {

enum class Network { kUNet, kVae, kTextEncoder, kControlNet };
/// "U-Net", for messages.
const char* name_of(Network network);

/// Whose names a file uses.
enum class Naming {
  kDiffusers,
  kLdm,       // LDM's and cldm's blocks in a row
  kOpenClip,  // the text encoder of SD 2.x single files
  kBareClip,  // transformers' names without "text_model."
};

struct TensorTable {
  std::filesystem::path where;  // the file or folder, for messages
  Network network = Network::kUNet;
  Naming naming = Naming::kDiffusers;
  std::string stored_prefix;                                 // of all names in the file
  std::map<std::string, StoredTensor, std::less<>> tensors;  // by diffusers' name
  std::vector<std::string> unknown;  // names, without prefix, of tensors that the network has no place for
  NameMap names;                     // empty for kDiffusers and kBareClip

  bool has_prefix(std::string_view prefix) const;
  /// The name that the file uses (or would use) for one of diffusers.
  std::string stored_name(const std::string& name) const;
};

/// The network's tensors among those of the files; nullopt if there are none.
std::optional<TensorTable> find_network(const WeightFiles& files, Network network);

/// A size of a tensor by diffusers' name. Throws Error{kFormat} naming it as stored if it is missing or has
/// fewer axes.
int64_t size_of(const TensorTable& table, const std::string& name, size_t axis);

}  // namespace patina::diffusion
