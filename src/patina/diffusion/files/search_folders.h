// Which files in the folders of AUTOMATIC1111, ComfyUI, Forge, diffusers or any other tool may be models, by
// name alone. No Torch here.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

namespace patina::diffusion {

/// What lies below some folders, by name alone; sorted within each folder given.
struct FoundFiles {
  std::vector<std::filesystem::path> weights;     // .safetensors files and folders of diffusers components
  std::vector<std::filesystem::path> models;      // folders of whole diffusers models
  std::vector<std::filesystem::path> tokenizers;  // folders with merges.txt
  std::vector<std::filesystem::path> pickles;     // .ckpt, .pth, .pt, .bin
};
/// Looks six folders deep, past caches, outputs and virtual environments. A folder that does not exist is
/// Error{kNotFound}.
FoundFiles search_folders(std::span<const std::filesystem::path> folders);

/// Whether it holds a whole diffusers model.
bool is_model_folder(const std::filesystem::path& path);

}  // namespace patina::diffusion
