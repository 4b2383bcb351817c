#include "patina/diffusion/text/prompt.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <utility>

#include "patina/base/check.h"
#include "patina/base/error.h"

namespace patina::diffusion {
namespace {

constexpr float kBracketFactor = 1.1f;
constexpr size_t kCommaReach = 20;  // tokens that may move to the next chunk for the sake of a comma

bool is_word_character(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || (c & 0x80);
}
char lower(char c) {
  return static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
}

/// ":1.3)" at the start of `text`: the number and the length of all of it.
std::optional<std::pair<float, size_t>> closing_weight(std::string_view text) {
  if (!text.starts_with(':')) return std::nullopt;
  size_t at = 1;
  const auto skip_spaces = [&] {
    while (at < text.size() && std::isspace(static_cast<unsigned char>(text[at]))) ++at;
  };
  skip_spaces();
  const size_t begin = at;
  while (at < text.size() && (std::isdigit(static_cast<unsigned char>(text[at])) || text[at] == '.' ||
                              ((text[at] == '+' || text[at] == '-') && at == begin)))
    ++at;
  const std::string number(text.substr(begin, at - begin));
  skip_spaces();
  char* end = nullptr;
  const float value = std::strtof(number.c_str(), &end);
  if (number.empty() || *end != '\0' || !std::isfinite(value) || at >= text.size() || text[at] != ')')
    return std::nullopt;
  return std::pair(value, at + 1);
}

/// Appends text, as parts of their own around each word BREAK.
void append_text(std::vector<PromptPart>& parts, std::string_view text) {
  constexpr std::string_view kBreak = "BREAK";
  for (size_t at = text.find(kBreak); at != std::string_view::npos; at = text.find(kBreak, at + 1)) {
    const size_t end = at + kBreak.size();
    if ((at > 0 && is_word_character(text[at - 1])) || (end < text.size() && is_word_character(text[end])))
      continue;
    parts.push_back({std::string(text.substr(0, at)), 1, false});
    parts.push_back({"", 1, true});
    text.remove_prefix(end);
    at = 0;
  }
  parts.push_back({std::string(text), 1, false});
}

/// A stretch of a part: a learned word, or text between such words.
struct Stretch {
  std::string_view text;
  const WordIds* word = nullptr;
};

bool word_stands_at(std::string_view text, size_t at, const std::string& word) {
  if (word.empty() || text.size() - at < word.size()) return false;
  for (size_t i = 0; i < word.size(); ++i) {
    if (lower(text[at + i]) != lower(word[i])) return false;
  }
  const size_t end = at + word.size();
  const bool joined_before = at > 0 && is_word_character(word.front()) && is_word_character(text[at - 1]);
  const bool joined_behind =
      end < text.size() && is_word_character(word.back()) && is_word_character(text[end]);
  return !joined_before && !joined_behind;
}

std::vector<Stretch> stretches_of(std::string_view text, std::span<const WordIds> words) {
  std::vector<Stretch> stretches;
  size_t begin = 0;
  for (size_t at = 0; at < text.size() && !words.empty();) {
    const WordIds* longest = nullptr;
    for (const WordIds& word : words) {
      if (word_stands_at(text, at, word.word) && (!longest || word.word.size() > longest->word.size()))
        longest = &word;
    }
    if (!longest) {
      ++at;
      continue;
    }
    stretches.push_back({text.substr(begin, at - begin), nullptr});
    stretches.push_back({text.substr(at, longest->word.size()), longest});
    begin = at = at + longest->word.size();
  }
  stretches.push_back({text.substr(begin), nullptr});
  return stretches;
}

/// Gathers tokens and closes chunks.
class Chunker {
 public:
  Chunker(const Tokenizer& tokenizer, size_t length)
      : tokenizer_(tokenizer), length_(length), room_(length - 2) {}

  void add_token(int64_t id, float weight) {
    if (id == tokenizer_.comma_id()) {
      behind_comma_ = tokens_.size() + 1;
    } else if (tokens_.size() == room_ && behind_comma_ > 0 &&
               tokens_.size() + 1 - behind_comma_ <= kCommaReach) {
      // What follows the comma goes to the next chunk with this token.
      const auto cut = tokens_.begin() + static_cast<std::ptrdiff_t>(behind_comma_);
      std::vector<std::pair<int64_t, float>> moved(cut, tokens_.end());
      tokens_.erase(cut, tokens_.end());
      close();
      tokens_ = std::move(moved);
    }
    if (tokens_.size() == room_) close();
    tokens_.emplace_back(id, weight);
  }
  void add_word(const WordIds& word, float weight) {
    if (tokens_.size() + static_cast<size_t>(word.count) > room_) close();
    for (int64_t i = 0; i < word.count; ++i) tokens_.emplace_back(word.first_id + i, weight);
  }
  void close() {
    TokenChunk chunk{{tokenizer_.begin_id()}, {1.0f}};
    for (const auto& [id, weight] : tokens_) chunk.ids.push_back(id), chunk.weights.push_back(weight);
    chunk.ids.push_back(tokenizer_.end_id());
    chunk.ids.resize(length_, tokenizer_.pad_id());
    chunk.weights.resize(length_, 1.0f);
    chunks_.push_back(std::move(chunk));
    tokens_.clear();
    behind_comma_ = 0;
  }
  std::vector<TokenChunk> finish() {
    if (!tokens_.empty() || chunks_.empty()) close();
    return std::move(chunks_);
  }

 private:
  const Tokenizer& tokenizer_;
  size_t length_, room_;
  std::vector<std::pair<int64_t, float>> tokens_;  // of the chunk that is open
  size_t behind_comma_ = 0;                        // number of its tokens up to the last comma; 0: none
  std::vector<TokenChunk> chunks_;
};

}  // namespace

std::vector<PromptPart> parse_prompt(std::string_view prompt) {
  for (const char* network : {"<lora:", "<lyco:"}) {
    if (prompt.find(network) != std::string_view::npos)
      throw Error(ErrorCode::kUsage, "prompt",
                  "holds " + std::string(network) +
                      "…>; LoRAs are given beside the prompt, each as its file and weight");
  }
  std::vector<PromptPart> parts;
  std::vector<size_t> round, square;  // first part inside each open bracket
  const auto scale = [&](std::vector<size_t>& open, float factor) {
    for (size_t i = open.back(); i < parts.size(); ++i) parts[i].weight *= factor;
    open.pop_back();
  };
  while (!prompt.empty()) {
    const char c = prompt.front();
    size_t length = 1;
    if (c == '\\') {
      // A sign behind the backslash stands for itself; a backslash alone for nothing.
      const bool escapes =
          prompt.size() > 1 && std::string_view("()[]\\").find(prompt[1]) != std::string_view::npos;
      length = escapes ? 2 : 1;
      parts.push_back({std::string(prompt.substr(1, length - 1)), 1, false});
    } else if (c == '(') {
      round.push_back(parts.size());
    } else if (c == '[') {
      square.push_back(parts.size());
    } else if (const auto weight = closing_weight(prompt); weight && !round.empty()) {
      scale(round, weight->first);
      length = weight->second;
    } else if (c == ')' && !round.empty()) {
      scale(round, kBracketFactor);
    } else if (c == ']' && !square.empty()) {
      scale(square, 1 / kBracketFactor);
    } else {
      length = std::max<size_t>(1, std::min(prompt.find_first_of("\\()[]:"), prompt.size()));
      append_text(parts, prompt.substr(0, length));
    }
    prompt.remove_prefix(length);
  }
  while (!round.empty()) scale(round, kBracketFactor);
  while (!square.empty()) scale(square, 1 / kBracketFactor);

  std::vector<PromptPart> merged;
  for (PromptPart& part : parts) {
    if (part.is_break) {
      part.weight = 1;
      merged.push_back(std::move(part));
    } else if (!merged.empty() && !merged.back().is_break && merged.back().weight == part.weight) {
      merged.back().text += part.text;
    } else if (!part.text.empty()) {
      merged.push_back(std::move(part));
    }
  }
  if (merged.empty()) merged.emplace_back();
  return merged;
}

bool TokenChunk::is_weighted() const {
  return std::any_of(weights.begin(), weights.end(), [](float weight) { return weight != 1; });
}

std::vector<TokenChunk> chunk_prompt(std::span<const PromptPart> parts, const Tokenizer& tokenizer,
                                     std::span<const WordIds> words, size_t length) {
  PATINA_CHECK_LE(size_t{3}, length);
  Chunker chunker(tokenizer, length);
  for (const PromptPart& part : parts) {
    if (part.is_break) {
      chunker.close();
      continue;
    }
    for (const Stretch& stretch : stretches_of(part.text, words)) {
      if (stretch.word) {
        if (static_cast<size_t>(stretch.word->count) > length - 2)
          throw Error(ErrorCode::kUsage, "embedding " + stretch.word->word,
                      "has " + std::to_string(stretch.word->count) + " vectors, more than the " +
                          std::to_string(length - 2) + " that the text encoder takes at once");
        chunker.add_word(*stretch.word, part.weight);
        continue;
      }
      for (const int64_t id : tokenizer.tokens(stretch.text)) chunker.add_token(id, part.weight);
    }
  }
  return chunker.finish();
}

TokenChunk empty_chunk(const Tokenizer& tokenizer, size_t length) {
  return Chunker(tokenizer, length).finish().front();
}

}  // namespace patina::diffusion
