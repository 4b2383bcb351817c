// Prompts as AUTOMATIC1111's web UI defines them: weights of words, learned words, and text of any length in
// chunks of the text encoder's positions. No Torch here.
//
//   (word) × 1.1, ((word)) × 1.21, [word] ÷ 1.1, (word:1.3) × 1.3, \( \) \[ \] for the signs themselves,
//   BREAK ends a chunk.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "patina/diffusion/text/tokenizer.h"

namespace patina::diffusion {

struct PromptPart {
  std::string text;
  float weight = 1;
  bool is_break = false;  // the word BREAK, without text

  bool operator==(const PromptPart&) const = default;
};

/// Neighbours of equal weight are one part; a text without any of the signs is one part of weight 1. Brackets
/// left open reach to the end. Throws Error{kUsage} for <lora:…>, which the command line takes.
std::vector<PromptPart> parse_prompt(std::string_view prompt);

/// A word of the prompt that stands for vectors: they have the ids `first_id`, …, beyond the vocabulary.
struct WordIds {
  std::string word;
  int64_t first_id = 0, count = 1;
};

/// What the text encoder takes at once.
struct TokenChunk {
  std::vector<int64_t> ids;    // [length]: begin, tokens, end, padding
  std::vector<float> weights;  // [length]; 1 for begin, end and padding

  bool is_weighted() const;
};

/// At least one chunk of `length` ids. A chunk that is full breaks at its last comma, if that is at most 20
/// tokens back; a word's vectors stay together.
std::vector<TokenChunk> chunk_prompt(std::span<const PromptPart> parts, const Tokenizer& tokenizer,
                                     std::span<const WordIds> words, size_t length);
/// The chunk of an empty prompt.
TokenChunk empty_chunk(const Tokenizer& tokenizer, size_t length);

}  // namespace patina::diffusion
