// Where CLIP's vocabulary lies. Single-file checkpoints hold none, but the tools that use them do: ComfyUI
// and Forge in their own trees, AUTOMATIC1111 through the cache of the Hugging Face libraries.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace patina::diffusion {

struct TokenizerSearch {
  std::filesystem::path given;                 // by the user; empty: search
  std::filesystem::path model;                 // a folder, or the single file beside which to look
  std::vector<std::filesystem::path> folders;  // trees of other tools
  int64_t vocabulary_size = 49408;             // of the text encoder
};

/// A folder with merges.txt, or a file of merges, of the right size. Throws Error{kNotFound} that says what
/// is missing and where to put it, Error{kFormat} if what was given does not fit.
std::filesystem::path find_tokenizer(const TokenizerSearch& search);

/// The cache of the Hugging Face libraries, as their environment variables place it; may not exist.
std::filesystem::path hugging_face_cache();

}  // namespace patina::diffusion
