#include "patina/diffusion/text/text_conditioning.h"

#include <algorithm>

#include <ATen/ATen.h>

#include "patina/base/error.h"
#include "patina/nn/weights.h"

namespace patina::diffusion {
namespace {

/// Of one prompt; tokens are weighted, the pooled vector is not.
TextConditioning encode_chunk(const TokenChunk& chunk, const TextEncoder& text_encoder,
                              const LearnedWords& words, int64_t clip_skip) {
  const at::Tensor ids = at::tensor(chunk.ids, at::kLong).unsqueeze(0);
  TextConditioning encoding = text_encoder(ids, clip_skip, {}, words.vectors);
  if (!chunk.is_weighted()) return encoding;
  const at::Tensor plain = encoding.tokens.to(at::kFloat);
  const at::Tensor weighted =
      plain * at::tensor(chunk.weights, at::kFloat).to(plain.device()).view({1, -1, 1});
  const double mean = plain.mean().item<double>(), weighted_mean = weighted.mean().item<double>();
  // Weights of 0 throughout leave nothing to bring back.
  const double restore = weighted_mean != 0 ? mean / weighted_mean : 1.0;
  encoding.tokens = (weighted * restore).to(encoding.tokens.scalar_type());
  return encoding;
}

}  // namespace

LearnedWords load_words(std::span<const LearnedWord> words, const TextEncoderConfig& config,
                        nn::Placement placement) {
  LearnedWords loaded;
  std::vector<at::Tensor> vectors;
  int64_t next = config.vocab_size;
  for (const LearnedWord& word : words) {
    const bool known = std::any_of(loaded.words.begin(), loaded.words.end(),
                                   [&](const WordIds& other) { return other.word == word.word; });
    if (known) continue;
    loaded.words.push_back({word.word, next, word.count});
    vectors.push_back(nn::read_tensor(*word.vectors.file, word.vectors.entry, placement.type)
                          .to(placement.device)
                          .reshape({word.count, config.hidden_size}));
    next += word.count;
  }
  if (!vectors.empty()) loaded.vectors = at::cat(vectors);
  return loaded;
}

TextConditioning encode_prompts(const Tokenizer& tokenizer, const TextEncoder& text_encoder,
                                const LearnedWords& words, std::span<const std::string> prompts,
                                int64_t clip_skip) {
  const TextEncoderConfig& config = text_encoder.config();
  if (clip_skip < 1 || clip_skip > config.num_layers)
    throw Error(ErrorCode::kUsage, "clip skip",
                "is " + std::to_string(clip_skip) + ", expected 1 (all layers) to " +
                    std::to_string(config.num_layers) + ", the layers of this text encoder");
  const size_t length = std::min(tokenizer.max_length(), static_cast<size_t>(config.max_positions));
  std::vector<std::vector<TokenChunk>> chunks;
  size_t num_chunks = 1;
  for (const std::string& prompt : prompts) {
    chunks.push_back(chunk_prompt(parse_prompt(prompt), tokenizer, words.words, length));
    num_chunks = std::max(num_chunks, chunks.back().size());
  }
  std::vector<TextConditioning> encoded;
  for (std::vector<TokenChunk>& of_prompt : chunks) {
    of_prompt.resize(num_chunks, empty_chunk(tokenizer, length));
    std::vector<at::Tensor> tokens;
    at::Tensor pooled;
    for (const TokenChunk& chunk : of_prompt) {
      const TextConditioning encoding = encode_chunk(chunk, text_encoder, words, clip_skip);
      tokens.push_back(encoding.tokens);
      if (!pooled.defined()) pooled = encoding.pooled;
    }
    encoded.push_back({at::cat(tokens, 1), pooled});
  }
  return stack_prompts(encoded);
}

}  // namespace patina::diffusion
