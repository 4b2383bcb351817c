#include "patina/diffusion/text/find_tokenizer.h"

#include <cstdlib>
#include <string>

#include "patina/base/error.h"
#include "patina/diffusion/files/search_folders.h"
#include "patina/diffusion/text/tokenizer.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

bool fits(const fs::path& path, int64_t vocabulary_size) {
  try {
    return Tokenizer(path).vocabulary_size() == static_cast<size_t>(vocabulary_size);
  } catch (const Error&) {
    return false;  // a tokenizer of another kind of model
  }
}

/// Where the trees of known tools hold it, from ComfyUI's and Forge's sources.
std::vector<fs::path> known_places(const fs::path& tree) {
  return {tree / "tokenizer", tree / "comfy" / "sd1_tokenizer",
          tree / "backend" / "huggingface" / "runwayml" / "stable-diffusion-v1-5" / "tokenizer"};
}

}  // namespace

fs::path hugging_face_cache() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return fs::path(value ? value : "");
  };
  if (const fs::path hub = variable("HF_HUB_CACHE"); !hub.empty()) return hub;
  if (const fs::path home = variable("HF_HOME"); !home.empty()) return home / "hub";
  if (const fs::path cache = variable("XDG_CACHE_HOME"); !cache.empty()) return cache / "huggingface" / "hub";
  return variable("HOME") / ".cache" / "huggingface" / "hub";
}

fs::path find_tokenizer(const TokenizerSearch& search) {
  if (!search.given.empty()) {
    if (!fs::exists(search.given))
      throw Error(ErrorCode::kNotFound, search.given.string(),
                  "does not exist; expected a folder with merges.txt and vocab.json, or a merges.txt");
    const size_t found = Tokenizer(search.given).vocabulary_size();
    if (found != static_cast<size_t>(search.vocabulary_size))
      throw Error(ErrorCode::kFormat, search.given.string(),
                  "is a tokenizer of " + std::to_string(found) + " tokens, expected the " +
                      std::to_string(search.vocabulary_size) + " that the text encoder knows");
    return search.given;
  }
  // A folder's own tokenizer is taken as it is; the text encoder refuses ids it does not know.
  if (fs::is_directory(search.model)) {
    if (!fs::exists(search.model / "tokenizer" / "merges.txt"))
      throw Error(ErrorCode::kNotFound, (search.model / "tokenizer").string(),
                  "holds no merges.txt; expected the model's tokenizer, or give the folder of another");
    return search.model / "tokenizer";
  }
  std::vector<fs::path> candidates{search.model.parent_path() / "tokenizer"};
  for (const fs::path& tree : search.folders) {
    for (const fs::path& place : known_places(tree)) candidates.push_back(place);
  }
  for (const fs::path& path : candidates) {
    if (fs::exists(path / "merges.txt") && fits(path, search.vocabulary_size)) return path;
  }
  // Then wherever a search finds one.
  std::vector<fs::path> trees = search.folders;
  if (const fs::path cache = hugging_face_cache(); fs::is_directory(cache)) trees.push_back(cache);
  for (const fs::path& path : search_folders(trees).tokenizers) {
    if (fits(path, search.vocabulary_size)) return path;
  }
  throw Error(
      ErrorCode::kNotFound, search.model.string(),
      "is a single file, which holds no tokenizer, and none of " + std::to_string(search.vocabulary_size) +
          " tokens was found. Any copy of CLIP's serves (merges.txt, and vocab.json beside it): give "
          "the folder of ComfyUI (comfy/sd1_tokenizer), of Forge or of any diffusers model as a model "
          "folder, or the tokenizer's own folder as the tokenizer, or put it into '" +
          (search.model.parent_path() / "tokenizer").string() + "'");
}

}  // namespace patina::diffusion
