// Textual inversion [Gal2022]: words that stand for learned vectors in the place of token embeddings. Read
// are A1111's files (emb_params, the word is the file's name) and diffusers' (a tensor named by its word). No
// Torch here.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
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

/// How names of tensors begin that kohya's trainer puts into a LoRA beside its own, with the words that were
/// trained together with it: "bundle_emb.<word>.string_to_param.*".
inline constexpr std::string_view kBundledEmbedding = "bundle_emb.";
/// The words that a LoRA brings along, most often none. Throws as read_embedding.
std::vector<LearnedWord> read_bundled_words(const std::filesystem::path& path, int64_t width);

}  // namespace patina::diffusion
