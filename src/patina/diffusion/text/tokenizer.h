// CLIP's tokenizer [Radford2021]: text to the ids of byte-level byte pairs [Sennrich2016], from merges.txt
// and the vocabulary that follows from it or stands in vocab.json.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace patina::diffusion {

class Tokenizer {
 public:
  /// Reads merges.txt and, where they are, vocab.json, tokenizer_config.json and special_tokens_map.json; or
  /// a file of merges alone. Without vocab.json the ids are CLIP's: bytes, bytes that end a word, merges,
  /// begin, end. `pad_id` replaces the padding that the files name. Throws Error.
  explicit Tokenizer(const std::filesystem::path& path, std::optional<int64_t> pad_id = {});

  /// Begin token, the text's tokens, end token; of any length.
  std::vector<int64_t> encode(std::string_view text) const;
  /// The same cut to `length` (keeping the end token) or padded to it.
  std::vector<int64_t> encode_padded(std::string_view text, size_t length) const;

  /// The text's tokens alone.
  std::vector<int64_t> tokens(std::string_view text) const;

  int64_t begin_id() const { return begin_.id; }
  int64_t end_id() const { return end_.id; }
  int64_t pad_id() const { return pad_.id; }
  /// Of a comma that ends a word.
  int64_t comma_id() const { return id_of(",</w>"); }
  size_t vocabulary_size() const { return vocabulary_.size(); }

  /// Tokens that the text encoder takes at once: 77 of CLIP.
  size_t max_length() const { return max_length_; }

 private:
  struct SpecialToken {
    std::string text;
    int64_t id = 0;
  };
  int64_t id_of(const std::string& token) const;
  /// Fills ranks_; returns what the pairs merge to, best first.
  std::vector<std::string> read_merges(const std::filesystem::path& file);
  void append_word(std::vector<int64_t>& ids, std::u32string_view word) const;
  void append_text(std::vector<int64_t>& ids, std::string_view text) const;

  std::unordered_map<std::string, int64_t> vocabulary_;
  std::map<std::pair<std::string, std::string>, int> ranks_;  // of the pairs that merge, best first
  std::array<std::string, 256> byte_symbols_;                 // a printable character for every byte
  SpecialToken begin_, end_, pad_, unknown_;
  size_t max_length_ = 77;
};

}  // namespace patina::diffusion
