#include "patina/diffusion/text/tokenizer.h"

#include <algorithm>
#include <limits>
#include <sstream>

#include <nlohmann/json.hpp>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/text/unicode.h"

namespace patina::diffusion {
namespace {

using Json = nlohmann::json;
constexpr std::string_view kWordEnd = "</w>";
constexpr uint64_t kMaxFileBytes = 1 << 26;

/// GPT-2's alphabet: printable bytes stand for themselves, the others for U+0100 and up, so that merges are
/// text.
std::array<std::string, 256> byte_alphabet() {
  std::array<std::string, 256> symbols;
  char32_t next = 0x100;
  for (char32_t byte = 0; byte < 256; ++byte) {
    const bool printable_byte =
        (byte >= '!' && byte <= '~') || (byte >= 0xA1 && byte <= 0xAC) || byte >= 0xAE;
    symbols[byte] = unicode::to_utf8(std::u32string(1, printable_byte ? byte : next++));
  }
  return symbols;
}

Json read_json(const std::filesystem::path& path) {
  Json json = Json::parse(read_text_file(path, kMaxFileBytes), nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) throw Error(ErrorCode::kFormat, path.string(), "is not a JSON object");
  return json;
}

/// A special token is given as its text or as an object that holds it.
std::string token_text(const Json& json, const std::string& key, const std::string& absent) {
  if (!json.contains(key)) return absent;
  const Json& value = json[key];
  if (value.is_string()) return value.get<std::string>();
  if (value.is_object() && value.contains("content") && value["content"].is_string())
    return value["content"].get<std::string>();
  return absent;
}

bool is_ideograph(char32_t c) {
  return (c >= 0x4E00 && c <= 0x9FFF) || (c >= 0x3400 && c <= 0x4DBF) || (c >= 0x20000 && c <= 0x2A6DF) ||
         (c >= 0x2A700 && c <= 0x2CEAF) || (c >= 0xF900 && c <= 0xFAFF) || (c >= 0x2F800 && c <= 0x2FA1F);
}

/// What CLIP's tokenizer of transformers does to text without the ftfy package: control characters go, white
/// space becomes spaces, ideographs stand alone, composition, lower case.
std::u32string clean(std::string_view text) {
  std::u32string out;
  for (const char32_t c : unicode::from_utf8(text)) {
    if (c == U'\t' || c == U'\n' || c == U'\r' || (unicode::is_space(c) && !unicode::is_control(c))) {
      out.push_back(U' ');
    } else if (is_ideograph(c)) {
      out += {U' ', c, U' '};
    } else if (c != 0xFFFD && !unicode::is_control(c)) {
      out.push_back(c);
    }
  }
  return unicode::lower(unicode::compose(out));
}

/// Length of the next word of `text`, which begins with no space: a special token, a contraction's end,
/// letters, one digit, or anything else up to the next of these.
size_t word_length(std::u32string_view text, std::initializer_list<std::u32string_view> special) {
  for (const std::u32string_view token : special) {
    if (text.starts_with(token)) return token.size();
  }
  for (const std::u32string_view token : {U"'s", U"'t", U"'re", U"'ve", U"'m", U"'ll", U"'d"}) {
    if (text.starts_with(token)) return token.size();
  }
  if (unicode::is_number(text.front())) return 1;
  const bool letters = unicode::is_letter(text.front());
  size_t length = 1;
  while (length < text.size()) {
    const char32_t c = text[length];
    if (letters ? !unicode::is_letter(c)
                : unicode::is_space(c) || unicode::is_letter(c) || unicode::is_number(c))
      break;
    ++length;
  }
  return length;
}

}  // namespace

/// Merges, one a line, best first, after a line with the version. The count is bounded as CLIP's own code
/// bounds it.
std::vector<std::string> Tokenizer::read_merges(const std::filesystem::path& file) {
  std::vector<std::string> merged;
  constexpr int kMaxMerges = 49152 - 256 - 2;
  std::istringstream merges(read_text_file(file, kMaxFileBytes));
  std::string line;
  std::getline(merges, line);
  for (int rank = 0; rank < kMaxMerges && std::getline(merges, line); ++rank) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty()) continue;
    const size_t space = line.find(' ');
    if (space == std::string::npos || line.find(' ', space + 1) != std::string::npos) {
      throw Error(ErrorCode::kFormat, file.string(),
                  "line " + std::to_string(rank + 2) + " is '" + printable(line, 40) +
                      "', expected two symbols with a space between");
    }
    ranks_.insert_or_assign({line.substr(0, space), line.substr(space + 1)}, rank);
    merged.push_back(line.substr(0, space) + line.substr(space + 1));
  }
  return merged;
}

Tokenizer::Tokenizer(const std::filesystem::path& path, std::optional<int64_t> pad_id)
    : byte_symbols_(byte_alphabet()) {
  const bool is_folder = std::filesystem::is_directory(path);
  const std::filesystem::path folder = is_folder ? path : path.parent_path();
  const std::filesystem::path vocabulary_file = folder / "vocab.json";
  const std::filesystem::path merges_file = is_folder ? path / "merges.txt" : path;
  if (is_folder && std::filesystem::exists(vocabulary_file)) {
    const Json vocabulary = read_json(vocabulary_file);
    for (const auto& [token, id] : vocabulary.items()) {
      if (!id.is_number_unsigned() || id.get<uint64_t>() > std::numeric_limits<int32_t>::max()) {
        throw Error(ErrorCode::kFormat, vocabulary_file.string(),
                    "token '" + printable(token, 40) + "' has the id " + printable(id.dump(), 40) +
                        ", expected an unsigned integer");
      }
      vocabulary_[token] = id.get<int64_t>();
    }
    read_merges(merges_file);
  } else {
    const std::vector<std::string> merged = read_merges(merges_file);
    // Bytes in the order of their symbols: those that stand for themselves first.
    std::vector<std::string> symbols(byte_symbols_.begin(), byte_symbols_.end());
    std::sort(symbols.begin(), symbols.end(), [](const std::string& a, const std::string& b) {
      return unicode::from_utf8(a) < unicode::from_utf8(b);
    });
    const auto add = [&](const std::string& token) {
      vocabulary_.emplace(token, static_cast<int64_t>(vocabulary_.size()));
    };
    for (const std::string& symbol : symbols) add(symbol);
    for (const std::string& symbol : symbols) add(symbol + std::string(kWordEnd));
    for (const std::string& symbol : merged) add(symbol);
    add("<|startoftext|>");
    add("<|endoftext|>");
  }

  Json config = Json::object();
  for (const char* name : {"special_tokens_map.json", "tokenizer_config.json"}) {
    if (is_folder && std::filesystem::exists(folder / name)) config.update(read_json(folder / name));
  }
  // An empty token would cut the text forever, so none may be empty.
  const auto special = [&](const char* key, const char* absent) {
    const std::string text = token_text(config, key, absent);
    const auto found = vocabulary_.find(text);
    if (found == vocabulary_.end() || text.empty()) {
      throw Error(ErrorCode::kFormat, vocabulary_file.string(),
                  std::string(key) + " '" + printable(text, 40) + "' is not in the vocabulary");
    }
    return SpecialToken{text, found->second};
  };
  begin_ = special("bos_token", "<|startoftext|>");
  end_ = special("eos_token", "<|endoftext|>");
  pad_ = special("pad_token", "<|endoftext|>");
  unknown_ = special("unk_token", "<|endoftext|>");
  if (pad_id) pad_.id = *pad_id;
  if (config.contains("model_max_length") && config["model_max_length"].is_number_unsigned()) {
    max_length_ =
        static_cast<size_t>(std::clamp<uint64_t>(config["model_max_length"].get<uint64_t>(), 2, 4096));
  }
}

int64_t Tokenizer::id_of(const std::string& token) const {
  const auto found = vocabulary_.find(token);
  return found == vocabulary_.end() ? unknown_.id : found->second;
}

void Tokenizer::append_word(std::vector<int64_t>& ids, std::u32string_view word) const {
  const std::string bytes = unicode::to_utf8(word);
  if (bytes == begin_.text || bytes == end_.text) {
    ids.push_back(id_of(bytes));
    return;
  }
  std::vector<std::string> symbols;
  for (const char byte : bytes) symbols.push_back(byte_symbols_[static_cast<uint8_t>(byte)]);
  symbols.back() += kWordEnd;

  // Merge the best pair, everywhere it stands, until none is left.
  while (symbols.size() > 1) {
    int best = std::numeric_limits<int>::max();
    std::pair<std::string, std::string> pair;
    for (size_t i = 0; i + 1 < symbols.size(); ++i) {
      const auto found = ranks_.find({symbols[i], symbols[i + 1]});
      if (found != ranks_.end() && found->second < best) best = found->second, pair = found->first;
    }
    if (best == std::numeric_limits<int>::max()) break;
    std::vector<std::string> merged;
    for (size_t i = 0; i < symbols.size(); ++i) {
      if (i + 1 < symbols.size() && symbols[i] == pair.first && symbols[i + 1] == pair.second) {
        merged.push_back(symbols[i] + symbols[i + 1]);
        ++i;
      } else {
        merged.push_back(symbols[i]);
      }
    }
    symbols = std::move(merged);
  }
  for (const std::string& symbol : symbols) ids.push_back(id_of(symbol));
}

void Tokenizer::append_text(std::vector<int64_t>& ids, std::string_view text) const {
  const std::u32string cleaned = clean(text);
  const std::u32string begin = unicode::from_utf8(begin_.text), end = unicode::from_utf8(end_.text);
  std::u32string_view rest = cleaned;
  while (!rest.empty()) {
    if (unicode::is_space(rest.front())) {
      rest.remove_prefix(1);
      continue;
    }
    const size_t length = word_length(rest, {begin, end});
    append_word(ids, rest.substr(0, length));
    rest.remove_prefix(length);
  }
}

std::vector<int64_t> Tokenizer::tokens(std::string_view text) const {
  std::vector<int64_t> ids;
  // Special tokens cut the text before anything else looks at it.
  while (!text.empty()) {
    const size_t begin_at = text.find(begin_.text), end_at = text.find(end_.text);
    const size_t at = std::min(begin_at, end_at);
    append_text(ids, text.substr(0, at));
    if (at == std::string_view::npos) break;
    const SpecialToken& token = begin_at < end_at ? begin_ : end_;
    ids.push_back(token.id);
    text.remove_prefix(at + token.text.size());
  }
  return ids;
}

std::vector<int64_t> Tokenizer::encode(std::string_view text) const {
  std::vector<int64_t> ids = tokens(text);
  ids.insert(ids.begin(), begin_.id);
  ids.push_back(end_.id);
  return ids;
}

std::vector<int64_t> Tokenizer::encode_padded(std::string_view text, size_t length) const {
  PATINA_CHECK_LE(size_t{2}, length);
  std::vector<int64_t> ids = encode(text);
  if (ids.size() > length) {
    ids.resize(length);
    ids.back() = end_.id;
  }
  ids.resize(length, pad_.id);
  return ids;
}

}  // namespace patina::diffusion
