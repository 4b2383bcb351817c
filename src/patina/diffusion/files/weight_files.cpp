#include "patina/diffusion/files/weight_files.h"

#include <set>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/base/files.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxIndexBytes = 1 << 26;

void add_file(WeightFiles& weights, const fs::path& path) {
  const auto file = std::make_shared<const nn::SafeTensors>(path);
  weights.files.push_back(file);
  for (const nn::TensorEntry& entry : file->tensors()) {
    const auto [found, fresh] = weights.tensors.emplace(entry.name, StoredTensor{file, entry});
    if (!fresh)
      throw Error(ErrorCode::kFormat, path.string(),
                  "tensor '" + printable(entry.name, 80) + "' is in " +
                      found->second.file->path().filename().string() + " too; expected it in one shard");
  }
}

/// An index maps each tensor to the shard beside it that holds it.
void add_shards(WeightFiles& weights, const fs::path& index) {
  const nlohmann::json json =
      nlohmann::json::parse(read_text_file(index, kMaxIndexBytes), nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("weight_map") || !json["weight_map"].is_object() ||
      json["weight_map"].empty())
    throw Error(ErrorCode::kFormat, index.string(),
                "is no index of shards; expected an object weight_map of tensor names and file names");
  std::set<std::string> shards;
  for (const auto& [tensor, shard] : json["weight_map"].items()) {
    // A name with a folder in it could read any file of the machine.
    if (!shard.is_string() || fs::path(shard.get<std::string>()).filename() != shard.get<std::string>())
      throw Error(ErrorCode::kFormat, index.string(),
                  "weight_map puts '" + printable(tensor, 80) + "' into " + printable(shard.dump(), 80) +
                      ", expected the name of a file beside the index");
    shards.insert(shard.get<std::string>());
  }
  for (const std::string& shard : shards) {
    const fs::path path = index.parent_path() / shard;
    if (!fs::exists(path))
      throw Error(ErrorCode::kNotFound, path.string(),
                  "is missing; " + index.filename().string() + " names it as one of " +
                      std::to_string(shards.size()) + " shards, all of which must lie beside it");
    add_file(weights, path);
  }
  for (const auto& [tensor, shard] : json["weight_map"].items()) {
    const auto found = weights.tensors.find(tensor);
    if (found == weights.tensors.end() || found->second.file->path().filename() != shard.get<std::string>())
      throw Error(ErrorCode::kFormat, (index.parent_path() / shard.get<std::string>()).string(),
                  "lacks the tensor '" + printable(tensor, 80) + "' that " + index.filename().string() +
                      " says it holds");
  }
}

}  // namespace

bool WeightFiles::has_prefix(std::string_view prefix) const {
  const auto found = tensors.lower_bound(prefix);
  return found != tensors.end() && found->first.starts_with(prefix);
}

fs::path weight_file(const fs::path& folder) {
  // Full precision first; "non_ema" is the state for training on, which is the last choice.
  const std::vector<std::string> variants{"", ".fp16", ".bf16", ".fp32", ".non_ema"};
  const std::vector<std::string> stems{"diffusion_pytorch_model", "model"};
  for (const std::string& variant : variants) {
    for (const std::string& stem : stems) {
      const std::string bare = variant.empty() ? "" : variant.substr(1) + ".";
      for (const std::string& name :
           {stem + variant + ".safetensors", stem + variant + ".safetensors.index.json",
            stem + ".safetensors.index." + bare + "json"}) {
        if (fs::exists(folder / name)) return folder / name;
      }
    }
  }
  for (const std::string& variant : variants) {
    for (const char* stem : {"diffusion_pytorch_model", "pytorch_model"}) {
      const fs::path pickle = folder / (stem + variant + ".bin");
      if (fs::exists(pickle)) nn::refuse_pickle_name(pickle);
    }
  }
  throw Error(
      ErrorCode::kNotFound, folder.string(),
      "holds no weights; expected diffusion_pytorch_model.safetensors or model.safetensors, or one of "
      "their variants (.fp16) and indices (.safetensors.index.json)");
}

WeightFiles open_weight_files(const fs::path& path) {
  WeightFiles weights;
  weights.where = path;
  const fs::path file = fs::is_directory(path) ? weight_file(path) : path;
  if (file.extension() == ".json")
    add_shards(weights, file);
  else
    add_file(weights, file);
  return weights;
}

}  // namespace patina::diffusion
