#include "patina/diffusion/files/embedding.h"

#include "patina/base/error.h"
#include "patina/diffusion/files/recognise.h"

namespace patina::diffusion {

namespace {

/// Throws unless the tensor holds vectors of the width.
LearnedWord learned_word(const std::string& word, const StoredTensor& tensor, int64_t width) {
  const std::vector<int64_t>& shape = tensor.entry.shape;
  if (shape.empty() || shape.size() > 2 || shape.back() != width || tensor.entry.num_elements() == 0)
    throw Error(ErrorCode::kFormat, tensor.file->path().string(),
                "tensor " + printable(tensor.entry.name, 80) + " has the shape " + nn::shape_text(shape) +
                    ", expected vectors of the text encoder's width [n, " + std::to_string(width) +
                    "]; the embedding was made for another family of models");
  nn::require_float(*tensor.file, tensor.entry);
  return {word, tensor, shape.size() == 2 ? shape[0] : 1};
}

}  // namespace

std::vector<LearnedWord> read_embedding(const std::filesystem::path& path, int64_t width) {
  const WeightFiles files = open_weight_files(path);
  require_kind(files, FileKind::kEmbedding);
  std::vector<LearnedWord> words;
  for (const auto& [name, tensor] : files.tensors) words.push_back(learned_word(name, tensor, width));
  if (words.size() == 1) {
    LearnedWord by_file = words.front();
    by_file.word = path.stem().string();
    if (words.front().word == "emb_params")
      words.front() = by_file;
    else if (words.front().word != by_file.word)
      words.push_back(by_file);
  }
  return words;
}

std::vector<LearnedWord> read_bundled_words(const std::filesystem::path& path, int64_t width) {
  constexpr std::string_view kVectors = ".string_to_param.*";
  const WeightFiles files = open_weight_files(path);
  std::vector<LearnedWord> words;
  for (const auto& [name, tensor] : files.tensors) {
    if (!name.starts_with(kBundledEmbedding) || !name.ends_with(kVectors)) continue;
    const std::string word =
        name.substr(kBundledEmbedding.size(), name.size() - kBundledEmbedding.size() - kVectors.size());
    words.push_back(learned_word(word, tensor, width));
  }
  return words;
}

}  // namespace patina::diffusion
