// Prompts as the U-Net sees them: each chunk of a prompt through the text encoder on its own, its tokens'
// vectors scaled by the words' weights, the chunks one behind the other.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "patina/diffusion/files/embedding.h"
#include "patina/diffusion/networks/text_encoder.h"
#include "patina/diffusion/text/prompt.h"

namespace patina::diffusion {

/// Learned words as the text encoder takes them.
struct LearnedWords {
  std::vector<WordIds> words;
  at::Tensor vectors;  // [n,D] of the encoder's type, on its device; undefined if there are none
};
/// Ids count on from the vocabulary's end. Of two words of one name the first counts.
LearnedWords load_words(std::span<const LearnedWord> words, const TextEncoderConfig& config,
                        nn::Placement placement);

/// All prompts with as many chunks as the longest has: tokens [prompts, chunks · positions, D], pooled
/// [prompts, D] of the first chunk, without weights. Weighted vectors are brought back to the mean that the
/// chunk had without weights, as A1111 does. Throws Error{kUsage}.
TextConditioning encode_prompts(const Tokenizer& tokenizer, const TextEncoder& text_encoder,
                                const LearnedWords& words, std::span<const std::string> prompts,
                                int64_t clip_skip = 1);

}  // namespace patina::diffusion
