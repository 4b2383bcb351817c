#include "patina/asset/obj_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "patina/base/text.h"

namespace patina::asset {
namespace {

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\0' || c == '\v' || c == '\f';
}

bool is_ascii(char c) {
  return static_cast<unsigned char>(c) < 0x80;
}

// A backslash at the end joins the next line. Behind a byte beyond ASCII it may be the second half of a
// two-byte character (GBK, Shift-JIS), so there it joins nothing.
bool is_continued(std::string_view line) {
  return line.ends_with('\\') && (line.size() == 1 || is_ascii(line[line.size() - 2]));
}

// The line that begins at `at`: its end, and where the next one begins.
struct Line {
  size_t end, next;
};
Line line_at(std::string_view text, size_t at) {
  const size_t end = std::min(text.find_first_of("\r\n", at), text.size());
  const bool crlf = end + 1 < text.size() && text[end] == '\r' && text[end + 1] == '\n';
  return {end, std::min(end + (crlf ? 2 : 1), text.size())};
}

std::string_view without_comment(std::string_view statement) {
  return trimmed(statement.substr(0, statement.find('#')));
}

size_t keyword_length(std::string_view statement) {
  size_t length = 0;
  while (length < statement.size() && !is_blank(statement[length])) ++length;
  return length;
}

void append_utf8(std::string& out, uint32_t code) {
  const auto tail = [&](int shift) { out += static_cast<char>(0x80u | (code >> shift & 0x3Fu)); };
  if (code < 0x80) {
    out += static_cast<char>(code);
  } else if (code < 0x800) {
    out += static_cast<char>(0xC0u | code >> 6);
    tail(0);
  } else if (code < 0x10000) {
    out += static_cast<char>(0xE0u | code >> 12);
    tail(6), tail(0);
  } else {
    out += static_cast<char>(0xF0u | code >> 18);
    tail(12), tail(6), tail(0);
  }
}

enum class Utf16 { kNone, kLittle, kBig };

Utf16 utf16_order(std::span<const uint8_t> file) {
  if (file.size() < 2) return Utf16::kNone;
  if (file[0] == 0xFF && file[1] == 0xFE) return Utf16::kLittle;
  if (file[0] == 0xFE && file[1] == 0xFF) return Utf16::kBig;
  // Without a mark: ASCII in UTF-16 has a zero in every second byte, and there only.
  const size_t looked_at = std::min<size_t>(file.size() / 2 * 2, 32);
  if (looked_at < 8) return Utf16::kNone;
  for (const size_t zero : {size_t{1}, size_t{0}}) {
    bool fits = true;
    for (size_t i = 0; i < looked_at && fits; ++i) fits = (file[i] == 0) == (i % 2 == zero);
    if (fits) return zero == 1 ? Utf16::kLittle : Utf16::kBig;
  }
  return Utf16::kNone;
}

template <class T>
std::optional<T> parsed(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  const char* const end = word.data() + word.size();
  T value = 0;
  const auto result = std::from_chars(word.data(), end, value);
  if (result.ec == std::errc::result_out_of_range && result.ptr == end) {
    // Too small is zero; too large is no finite number. A long double has the exponents to tell.
    long double wide = 0;
    const auto again = std::from_chars(word.data(), end, wide);
    if (again.ec == std::errc() && std::abs(wide) < 1.0L) return T{0};
    return std::nullopt;
  }
  if (result.ec != std::errc() || result.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

bool ends_in_name(std::string_view keyword) {
  if (keyword.size() < 3 && keyword != "g" && keyword != "o") return false;  // v, vt, vn, f: most lines
  constexpr std::array<std::string_view, 11> kKeywords = {
      "g", "o", "usemtl", "mtllib", "newmtl", "norm", "bump", "disp", "decal", "refl", "usemap"};
  const std::string name = lowered(std::string(keyword));
  return name.starts_with("map_") || std::find(kKeywords.begin(), kKeywords.end(), name) != kKeywords.end();
}

std::vector<TextLine> text_lines(std::string_view text) {
  std::vector<TextLine> lines;
  size_t at = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  for (size_t line_number = 1; at < text.size(); ++line_number) {
    const size_t begin = at, first_number = line_number;
    Line line = line_at(text, at);
    std::string_view statement = trimmed(text.substr(at, line.end - at));
    std::string joined;
    if (is_continued(statement)) {
      for (;;) {
        const bool more = is_continued(statement) && line.next < text.size();
        if (more) statement.remove_suffix(1);
        joined.append(statement).append(" ");
        if (!more) break;
        ++line_number;
        at = line.next;
        line = line_at(text, at);
        statement = trimmed(text.substr(at, line.end - at));
      }
      statement = trimmed(joined);
    }
    at = line.next;
    if (statement.starts_with('#')) continue;
    if (!ends_in_name(statement.substr(0, keyword_length(statement)))) statement = without_comment(statement);
    if (statement.empty()) continue;
    const size_t split = keyword_length(statement);
    lines.push_back({first_number, std::string(statement.substr(0, split)),
                     std::string(trimmed(statement.substr(split))), begin, line.end, line.next});
  }
  return lines;
}

std::optional<std::string> utf8_from_utf16(std::span<const uint8_t> file) {
  const Utf16 order = utf16_order(file);
  if (order == Utf16::kNone) return std::nullopt;
  const auto unit = [&](size_t i) -> uint32_t {
    return order == Utf16::kLittle ? file[i] | uint32_t{file[i + 1]} << 8
                                   : file[i + 1] | uint32_t{file[i]} << 8;
  };
  std::string out;
  out.reserve(file.size() / 2);
  for (size_t i = 0; i + 1 < file.size(); i += 2) {
    uint32_t code = unit(i);
    if (i == 0 && code == 0xFEFF) continue;
    if (code >= 0xD800 && code <= 0xDBFF && i + 3 < file.size() && (unit(i + 2) & 0xFC00u) == 0xDC00u) {
      code = 0x10000 + ((code - 0xD800) << 10) + (unit(i + 2) - 0xDC00);
      i += 2;
    } else if ((code & 0xF800u) == 0xD800u) {
      code = 0xFFFD;  // half a pair
    }
    append_utf8(out, code);
  }
  return out;
}

std::string_view unquoted(std::string_view name) {
  const bool is_quoted = name.size() >= 2 && name.front() == '"' && name.find('"', 1) == name.size() - 1;
  return is_quoted ? trimmed(name.substr(1, name.size() - 2)) : name;
}

std::vector<std::string> name_spellings(std::string_view rest) {
  std::vector<std::string> out;
  const auto add = [&](std::string_view name) {
    if (!name.empty() && std::find(out.begin(), out.end(), name) == out.end()) out.emplace_back(name);
  };
  const auto add_unquoted = [&](std::string_view name) {
    add(name);
    add(unquoted(name));
  };
  add_unquoted(rest);
  for (size_t i = 1; i < rest.size(); ++i)
    if (rest[i] == '#' && is_blank(rest[i - 1])) {
      add_unquoted(trimmed(rest.substr(0, i)));
      break;
    }
  return out;
}

std::vector<std::string> separate_names(std::string_view rest) {
  std::vector<std::string> out;
  for (rest = trimmed(rest); !rest.empty(); rest = trimmed(rest)) {
    const size_t quote = rest.front() == '"' ? rest.find('"', 1) : std::string_view::npos;
    const bool quoted = quote != std::string_view::npos;
    const size_t end = quoted ? quote : keyword_length(rest);
    const std::string_view name = quoted ? rest.substr(1, end - 1) : rest.substr(0, end);
    if (!name.empty()) out.emplace_back(name);
    rest.remove_prefix(end + (quoted ? 1 : 0));
  }
  return out;
}

std::vector<std::string_view> words(std::string_view text) {
  std::vector<std::string_view> out;
  for (size_t at = 0; at < text.size();) {
    while (at < text.size() && is_blank(text[at])) ++at;
    const size_t begin = at;
    while (at < text.size() && !is_blank(text[at])) ++at;
    if (at > begin) out.push_back(text.substr(begin, at - begin));
  }
  return out;
}

std::optional<float> number(std::string_view word) {
  return parsed<float>(word);
}
std::optional<double> wide_number(std::string_view word) {
  return parsed<double>(word);
}

}  // namespace patina::asset
