#include "patina/diffusion/files/search_folders.h"

#include <algorithm>
#include <set>
#include <string>

#include "patina/base/error.h"
#include "patina/diffusion/files/weight_files.h"

namespace patina::diffusion {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDepth = 6;

/// Folders of tools that hold no models, or too many other files.
bool is_skipped(const std::string& name) {
  static const std::set<std::string> kSkipped{
      "venv",    "node_modules", "site-packages", "__pycache__",    "output",
      "outputs", "custom_nodes", "repositories",  "python_embeded", "blobs"};
  return name.starts_with('.') || kSkipped.contains(name);
}

bool is_pickle(const fs::path& path) {
  static const std::set<std::string> kPickles{".ckpt", ".pth", ".pt", ".bin"};
  return kPickles.contains(path.extension().string());
}

/// False too where the folder may not be read.
bool there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

bool has_weights(const fs::path& folder) {
  try {
    weight_file(folder);
    return true;
  } catch (const Error&) {
    return false;
  }
}

void search(FoundFiles& found, const fs::path& folder, int depth) {
  if (there(folder / "merges.txt")) found.tokenizers.push_back(folder);
  const bool is_model = is_model_folder(folder);
  if (is_model) found.models.push_back(folder);
  const bool is_component = there(folder / "config.json") && has_weights(folder);
  if (is_component) found.weights.push_back(folder);

  std::error_code ignored;
  std::vector<fs::path> entries;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored))
    entries.push_back(entry.path());
  std::sort(entries.begin(), entries.end());
  for (const fs::path& entry : entries) {
    const std::string name = entry.filename().string();
    if (fs::is_directory(entry, ignored)) {
      // Inside a whole model only its tokenizer is of use by itself.
      if (is_model ? name == "tokenizer" : depth < kMaxDepth && !is_skipped(name))
        search(found, entry, depth + 1);
    } else if (!is_model && !is_component && fs::is_regular_file(entry, ignored)) {
      if (entry.extension() == ".safetensors") found.weights.push_back(entry);
      if (is_pickle(entry)) found.pickles.push_back(entry);
    }
  }
}

}  // namespace

bool is_model_folder(const fs::path& path) {
  return there(path / "model_index.json") || there(path / "unet" / "config.json");
}

FoundFiles search_folders(std::span<const fs::path> folders) {
  FoundFiles found;
  for (const fs::path& folder : folders) {
    if (!fs::is_directory(folder))
      throw Error(ErrorCode::kNotFound, folder.string(), "is no folder; expected one that holds models");
    search(found, folder, 0);
  }
  return found;
}

}  // namespace patina::diffusion
