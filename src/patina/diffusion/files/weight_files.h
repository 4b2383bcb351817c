// The safetensors files behind one path: a file, the shards that an index names, or the folder of a diffusers
// component. Headers are read and checked, tensors are not touched. No Torch here.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "patina/nn/safetensors.h"

namespace patina::diffusion {

/// A tensor and the file whose map its bytes lie in. The entry may be part of a stored one.
struct StoredTensor {
  std::shared_ptr<const nn::SafeTensors> file;
  nn::TensorEntry entry;
};

struct WeightFiles {
  std::filesystem::path where;  // as given
  std::vector<std::shared_ptr<const nn::SafeTensors>> files;
  std::map<std::string, StoredTensor, std::less<>> tensors;  // of all files, by stored name

  bool has_prefix(std::string_view prefix) const;
};

/// `path` is a .safetensors file, an index (.safetensors.index.json) or a folder that holds either under
/// diffusers' names, its variants (.fp16 and others) included. Throws Error{kNotFound, kFormat, kUnsupported}
/// that names the file and tensor; pickles are refused with the reason.
WeightFiles open_weight_files(const std::filesystem::path& path);

/// The file or index in the folder of a component. Throws Error{kNotFound} that says what was looked for.
std::filesystem::path weight_file(const std::filesystem::path& folder);

}  // namespace patina::diffusion
