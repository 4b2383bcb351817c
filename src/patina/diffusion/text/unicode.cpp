#include "patina/diffusion/text/unicode.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>

#include "patina/diffusion/text/unicode_tables.h"

namespace patina::diffusion::unicode {
namespace {

constexpr char32_t kReplacement = 0xFFFD;

// Hangul syllables are composed by arithmetic [Unicode, Sec. 3.12].
constexpr char32_t kSyllables = 0xAC00, kLeads = 0x1100, kVowels = 0x1161, kTails = 0x11A7;
constexpr char32_t kNumLeads = 19, kNumVowels = 21, kNumTails = 28,
                   kNumSyllables = kNumLeads * kNumVowels * kNumTails;

/// The row whose [first, last] holds c, or null.
template <class Table>
const typename Table::value_type* find_range(const Table& table, char32_t c) {
  const auto after = std::upper_bound(table.begin(), table.end(), c,
                                      [](char32_t x, const auto& row) { return x < row.first; });
  if (after == table.begin() || (after - 1)->last < c) return nullptr;
  return &*(after - 1);
}

template <class Table>
const Decomposition* find_decomposition(const Table& table, char32_t c) {
  const auto row = std::lower_bound(table.begin(), table.end(), c,
                                    [](const auto& r, char32_t x) { return r.character < x; });
  return row != table.end() && row->character == c ? &*row : nullptr;
}

int combining_class(char32_t c) {
  const CombiningRange* row = find_range(kCombining, c);
  return row ? row->combining_class : 0;
}

void append_decomposed(std::u32string& out, char32_t c) {
  if (c >= kSyllables && c < kSyllables + kNumSyllables) {
    const char32_t index = c - kSyllables, tail = index % kNumTails;
    out.push_back(kLeads + index / (kNumVowels * kNumTails));
    out.push_back(kVowels + index / kNumTails % kNumVowels);
    if (tail) out.push_back(kTails + tail);
    return;
  }
  const Decomposition* row = find_decomposition(kComposing, c);
  if (!row) row = find_decomposition(kDecomposing, c);
  if (!row) {
    out.push_back(c);
    return;
  }
  append_decomposed(out, row->first);
  if (row->second) append_decomposed(out, row->second);
}

/// The one character that a pair composes to, or 0.
char32_t composed(char32_t a, char32_t b) {
  if (a >= kLeads && a < kLeads + kNumLeads && b >= kVowels && b < kVowels + kNumVowels) {
    return kSyllables + ((a - kLeads) * kNumVowels + (b - kVowels)) * kNumTails;
  }
  if (a >= kSyllables && a < kSyllables + kNumSyllables && (a - kSyllables) % kNumTails == 0 && b > kTails &&
      b < kTails + kNumTails) {
    return a + (b - kTails);
  }
  static const std::map<std::pair<char32_t, char32_t>, char32_t> pairs = [] {
    std::map<std::pair<char32_t, char32_t>, char32_t> map;
    for (const Decomposition& row : kComposing) map[{row.first, row.second}] = row.character;
    return map;
  }();
  const auto found = pairs.find({a, b});
  return found == pairs.end() ? 0 : found->second;
}

}  // namespace

std::u32string from_utf8(std::string_view text) {
  std::u32string out;
  out.reserve(text.size());
  for (size_t i = 0; i < text.size();) {
    const auto lead = static_cast<uint8_t>(text[i]);
    const size_t length = lead < 0x80                   ? 1
                          : lead >= 0xC2 && lead < 0xE0 ? 2
                          : lead >= 0xE0 && lead < 0xF0 ? 3
                          : lead >= 0xF0 && lead < 0xF5 ? 4
                                                        : 0;
    char32_t c = length == 1 ? lead : length == 2 ? lead & 0x1Fu : length == 3 ? lead & 0x0Fu : lead & 0x07u;
    bool good = length > 0 && i + length <= text.size();
    for (size_t k = 1; good && k < length; ++k) {
      const auto byte = static_cast<uint8_t>(text[i + k]);
      good = (byte & 0xC0) == 0x80;
      c = c << 6 | (byte & 0x3Fu);
    }
    // Overlong forms, surrogates and what lies past the last code point are malformed too.
    if (good && ((length == 3 && c < 0x800) || (length == 4 && (c < 0x10000 || c > 0x10FFFF)) ||
                 (c >= 0xD800 && c < 0xE000)))
      good = false;
    out.push_back(good ? c : kReplacement);
    i += good ? length : 1;
  }
  return out;
}

std::string to_utf8(std::u32string_view text) {
  std::string out;
  const auto push = [&](char32_t bits) { out.push_back(static_cast<char>(static_cast<uint8_t>(bits))); };
  for (const char32_t c : text) {
    if (c < 0x80) {
      push(c);
    } else if (c < 0x800) {
      push(0xC0 | c >> 6), push(0x80 | (c & 0x3F));
    } else if (c < 0x10000) {
      push(0xE0 | c >> 12), push(0x80 | (c >> 6 & 0x3F)), push(0x80 | (c & 0x3F));
    } else {
      push(0xF0 | c >> 18), push(0x80 | (c >> 12 & 0x3F)), push(0x80 | (c >> 6 & 0x3F)),
          push(0x80 | (c & 0x3F));
    }
  }
  return out;
}

bool is_letter(char32_t c) {
  return find_range(kLetters, c) != nullptr;
}
bool is_number(char32_t c) {
  return find_range(kNumbers, c) != nullptr;
}
bool is_control(char32_t c) {
  return find_range(kControls, c) != nullptr;
}

bool is_space(char32_t c) {
  return (c >= 0x09 && c <= 0x0D) || (c >= 0x1C && c <= 0x20) || c == 0x85 || c == 0xA0 || c == 0x1680 ||
         (c >= 0x2000 && c <= 0x200A) || c == 0x2028 || c == 0x2029 || c == 0x202F || c == 0x205F ||
         c == 0x3000;
}

std::u32string lower(std::u32string_view text) {
  constexpr char32_t kDottedI = 0x130, kDotAbove = 0x307;
  std::u32string out;
  for (const char32_t c : text) {
    const LowerRun* run = find_range(kLower, c);
    if (c == kDottedI) {
      out += {U'i', kDotAbove};
    } else if (run && (c - run->first) % static_cast<char32_t>(run->stride) == 0) {
      out.push_back(static_cast<char32_t>(static_cast<int32_t>(c) + run->delta));
    } else {
      out.push_back(c);
    }
  }
  return out;
}

std::u32string compose(std::u32string_view text) {
  std::u32string decomposed;
  for (const char32_t c : text) append_decomposed(decomposed, c);

  // Marks after a base are put into the order of their classes.
  for (size_t begin = 0; begin < decomposed.size();) {
    size_t end = begin;
    while (end < decomposed.size() && combining_class(decomposed[end]) != 0) ++end;
    std::stable_sort(decomposed.begin() + static_cast<std::ptrdiff_t>(begin),
                     decomposed.begin() + static_cast<std::ptrdiff_t>(end),
                     [](char32_t a, char32_t b) { return combining_class(a) < combining_class(b); });
    begin = end + 1;
  }

  // A character joins the last starter unless one of the same or a higher class stands between.
  std::u32string out;
  size_t starter = std::u32string::npos;
  int last_class = 0;
  for (const char32_t c : decomposed) {
    const int this_class = combining_class(c);
    if (starter != std::u32string::npos &&
        (starter + 1 == out.size() || (last_class < this_class && last_class != 0))) {
      if (const char32_t joined = composed(out[starter], c)) {
        out[starter] = joined;
        continue;
      }
    }
    if (this_class == 0) starter = out.size();
    last_class = this_class;
    out.push_back(c);
  }
  return out;
}

}  // namespace patina::diffusion::unicode
