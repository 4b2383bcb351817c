// Text of unknown origin: is it UTF-8, and how does it become UTF-8?
#pragma once

#include <string>
#include <string_view>

namespace patina {

/// Bytes of the valid UTF-8 sequence at `text[i]`, or 0: overlong forms and surrogates are refused.
size_t utf8_length(std::string_view text, size_t i);

bool valid_utf8(std::string_view text);

/// `text` itself where it is UTF-8; else every byte of it as a Latin-1 character. For names that go into
/// JSON or HTML: always valid, and texts that differ stay different.
std::string as_utf8(std::string_view text);

}  // namespace patina
