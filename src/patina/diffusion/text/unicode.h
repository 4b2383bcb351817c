// The little of Unicode that a tokenizer needs: UTF-8, character classes, lower case, canonical composition
// (NFC). The properties of characters come from utf8proc.
#pragma once

#include <string>
#include <string_view>

namespace patina::diffusion::unicode {

/// Code points of UTF-8 text; every malformed byte becomes U+FFFD.
std::u32string from_utf8(std::string_view text);
std::string to_utf8(std::u32string_view text);

bool is_letter(char32_t c);   // \p{L}
bool is_number(char32_t c);   // \p{N}
bool is_control(char32_t c);  // Cc, Cf, Co
bool is_space(char32_t c);    // \s: White_Space and U+001C..U+001F

/// Lower case, character by character (İ becomes i and a dot above; the final sigma is not told apart).
std::u32string lower(std::u32string_view text);

/// Normalization Form C [Unicode, Annex 15].
std::u32string compose(std::u32string_view text);

}  // namespace patina::diffusion::unicode
