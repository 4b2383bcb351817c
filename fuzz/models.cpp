// Targets: weight files, tokenizer files and prompts.
#include "bytes.h"
#include "patina/base/error.h"
#include "patina/diffusion/text/prompt.h"
#include "patina/nn/safetensors.h"
#include "targets.h"

namespace patina::fuzz {

void weights(std::span<const uint8_t> bytes) {
  const nn::SafeTensors file(scratch_file("x.safetensors", bytes));
  uint64_t sum = 0;
  for (const nn::TensorEntry& tensor : file.tensors()) {
    require(file.find(tensor.name) != nullptr, "every tensor is found by its name");
    require(tensor.num_elements() >= 0, "no tensor has a negative size");
    for (const uint8_t byte : tensor.bytes) sum += byte;
  }
  require(sum <= bytes.size() * 255, "tensors lie in the file, each in its own place");
}

// merges.txt, vocab.json (may be empty: none) and a text, set apart by zeros.
void tokenizer(std::span<const uint8_t> all) {
  Bytes bytes(all);
  const auto write = [](const char* name, std::string_view text) {
    return scratch_file(name, std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
  };
  const auto merges = write("merges.txt", bytes.text());
  const std::string_view vocabulary = bytes.text();
  if (vocabulary.empty())
    std::filesystem::remove(scratch_folder() / "vocab.json");
  else
    write("vocab.json", vocabulary);
  const diffusion::Tokenizer made(vocabulary.empty() ? merges : scratch_folder());
  const auto ids = made.encode(bytes.text());
  require(ids.front() == made.begin_id() && ids.back() == made.end_id(), "a text begins and ends");
  require(made.encode_padded("a b", 8).size() == 8, "a padded text has its length");
}

void prompt(std::span<const uint8_t> bytes) {
  static const diffusion::Tokenizer tokenizer(source_root() / "tests/data/tiny-sd/tokenizer");
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::vector<diffusion::PromptPart> parts = diffusion::parse_prompt(text);
  const std::vector<diffusion::WordIds> words{{"rust", 50000, 3}};
  const auto chunks = diffusion::chunk_prompt(parts, tokenizer, words, 77);
  require(!chunks.empty(), "a prompt has a chunk");
  for (const diffusion::TokenChunk& chunk : chunks) {
    require(chunk.ids.size() == 77 && chunk.weights.size() == 77, "a chunk has the encoder's length");
    require(chunk.ids.front() == tokenizer.begin_id(), "a chunk begins");
  }
}

}  // namespace patina::fuzz
