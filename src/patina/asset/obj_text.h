// What OBJ and MTL files share: lines with a number, words and numbers on them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace patina::asset {

/// One statement: its keyword and the rest of the line, comments, continuation and surrounding blanks
/// removed.
struct TextLine {
  size_t number = 0;  // of the first physical line, from 1
  std::string keyword;
  std::string rest;
  size_t begin = 0, end = 0;  // range of the statement in the text, without the line's end
};

/// Statements of an OBJ or MTL file; a byte order mark is skipped, CR LF and NUL count as blanks.
std::vector<TextLine> text_lines(std::string_view text);

std::vector<std::string_view> words(std::string_view text);

/// The whole word as a finite number, or nothing.
std::optional<float> number(std::string_view word);

}  // namespace patina::asset
