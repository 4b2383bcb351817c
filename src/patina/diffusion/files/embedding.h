// Textual inversion [Gal2022]: words that stand for learned vectors in the place of token embeddings. Read
// are A1111's files (emb_params, the word is the file's name) and diffusers' (a tensor named by its word). No
// Torch here.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/diffusion/files/weight_files.h"

namespace patina::diffusion {

struct LearnedWord {
  std::string word;
  StoredTensor vectors;  // [count, width] or [width]
  int64_t count = 1;
};

/// The words of one file; a file of one word answers to its own name too. `width` is that of the text
/// encoder. Throws Error naming file and tensor, expected and found.
std::vector<LearnedWord> read_embedding(const std::filesystem::path& path, int64_t width);

}  // namespace patina::diffusion
