// What OBJ and MTL files share: lines with a number, words and numbers on them, names.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
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
  size_t next = 0;            // where the next line begins
};

/// Statements of an OBJ or MTL file. Lines end in LF, CR LF or CR; a byte order mark is skipped, NUL counts
/// as a blank. '#' begins a comment at a line's start and in statements of numbers; in a statement that ends
/// in a name ("newmtl Material #25") it is part of the name.
std::vector<TextLine> text_lines(std::string_view text);

/// The file as UTF-8 where it is UTF-16, by its byte order mark or by its zero bytes; else nothing, and the
/// bytes are text as they are.
std::optional<std::string> utf8_from_utf16(std::span<const uint8_t> file);

/// Whether a statement (keyword in any case) ends in a name: a material, a group or a file.
bool ends_in_name(std::string_view keyword);

/// A name without the quotes around it, if there are any.
std::string_view unquoted(std::string_view name);

/// How the rest of a statement may spell one name: as it stands, without quotes, without a comment behind
/// it. Most likely first, all different.
std::vector<std::string> name_spellings(std::string_view rest);

/// Names that follow one another on a line: separated by blanks, those with blanks in quotes.
std::vector<std::string> separate_names(std::string_view rest);

std::vector<std::string_view> words(std::string_view text);
std::string_view trimmed(std::string_view text);

/// The whole word as a finite number, or nothing. Numbers too small for the type are zero.
std::optional<float> number(std::string_view word);
std::optional<double> wide_number(std::string_view word);

}  // namespace patina::asset
