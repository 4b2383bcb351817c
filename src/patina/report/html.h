// Small pieces of HTML: text that cannot break out of its place, and data that needs no file.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace patina::report {

/// `text` for element content and quoted attributes: markup characters become entities, line breaks spaces,
/// other control characters and invalid UTF-8 are shown as \xNN. Cut to `max_length` bytes.
std::string escaped(std::string_view text, size_t max_length = 4000);

/// The same for preformatted text, which keeps its line breaks.
std::string escaped_lines(std::string_view text);

/// "data:<mime>;base64,..." [RFC 2397, RFC 4648 Sec. 4].
std::string data_uri(std::span<const uint8_t> bytes, std::string_view mime);

/// `value` with about three significant digits, without trailing zeros below one, and no exponent between
/// 1e-4 and 1e7; "n/a" for NaN, "∞" for infinity.
std::string number(double value);

/// "42 s", "3 min 05 s", "1 h 02 min".
std::string duration(double seconds);

}  // namespace patina::report
