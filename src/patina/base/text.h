// Small functions on text.
#pragma once

#include <charconv>
#include <optional>
#include <string>
#include <string_view>

namespace patina {

/// `text` with the letters A to Z in lower case; other bytes, UTF-8 among them, stay as they are.
std::string lowered(std::string text);

/// All of `text` as a Number, whatever the locale; nullopt where it is none, or too large.
template <class Number>
std::optional<Number> parse_number(std::string_view text) {
  Number value{};
  const char* const end = text.data() + text.size();
  const auto [rest, failure] = std::from_chars(text.data(), end, value);
  return failure == std::errc() && rest == end ? std::optional(value) : std::nullopt;
}

}  // namespace patina
