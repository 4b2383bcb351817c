#include "patina/asset/obj_text.h"

#include <charconv>
#include <cmath>

namespace patina::asset {
namespace {

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\0' || c == '\v' || c == '\f';
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

}  // namespace

std::vector<TextLine> text_lines(std::string_view text) {
  std::vector<TextLine> lines;
  size_t at = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  for (size_t line_number = 1; at < text.size(); ++line_number) {
    const size_t begin = at, first_number = line_number;
    std::string joined;
    const std::string* continued = nullptr;
    std::string_view statement;
    size_t end = begin;
    // A backslash at the end joins the next line.
    for (;;) {
      end = std::min(text.find('\n', at), text.size());
      std::string_view physical = trimmed(text.substr(at, end - at));
      at = std::min(end + 1, text.size());
      const bool more = physical.ends_with('\\') && at < text.size();
      if (more) physical.remove_suffix(1);
      if (!continued && !more) {
        statement = physical;
        break;
      }
      joined.append(physical).append(" ");
      continued = &joined;
      if (!more) break;
      ++line_number;
    }
    if (continued) statement = trimmed(*continued);
    if (const size_t comment = statement.find('#'); comment != std::string_view::npos)
      statement = trimmed(statement.substr(0, comment));
    if (statement.empty()) continue;
    size_t split = 0;
    while (split < statement.size() && !is_blank(statement[split])) ++split;
    lines.push_back({first_number, std::string(statement.substr(0, split)),
                     std::string(trimmed(statement.substr(split))), begin, end});
  }
  return lines;
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
  if (word.starts_with('+')) word.remove_prefix(1);
  float value = 0;
  const auto [end, failure] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (failure == std::errc::result_out_of_range) {
    // Too small is zero; too large is no finite number.
    double wide = 0;
    const auto again = std::from_chars(word.data(), word.data() + word.size(), wide);
    if (again.ec == std::errc() && again.ptr == word.data() + word.size() && std::abs(wide) < 1.0)
      return 0.0f;
    return std::nullopt;
  }
  if (failure != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

}  // namespace patina::asset
