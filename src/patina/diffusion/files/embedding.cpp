#include "patina/diffusion/files/embedding.h"

#include "patina/base/error.h"
#include "patina/diffusion/files/recognise.h"

namespace patina::diffusion {

std::vector<LearnedWord> read_embedding(const std::filesystem::path& path, int64_t width) {
  const WeightFiles files = open_weight_files(path);
  require_kind(files, FileKind::kEmbedding);
  std::vector<LearnedWord> words;
  for (const auto& [name, tensor] : files.tensors) {
    const std::vector<int64_t>& shape = tensor.entry.shape;
    if (shape.empty() || shape.size() > 2 || shape.back() != width || tensor.entry.num_elements() == 0)
      throw Error(ErrorCode::kFormat, path.string(),
                  "tensor " + printable(name, 80) + " has the shape " + nn::shape_text(shape) +
                      ", expected vectors of the text encoder's width [n, " + std::to_string(width) +
                      "]; the embedding was made for another family of models");
    words.push_back({name, tensor, shape.size() == 2 ? shape[0] : 1});
  }
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

}  // namespace patina::diffusion
