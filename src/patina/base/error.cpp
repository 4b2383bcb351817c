#include "patina/base/error.h"

namespace patina {
namespace {

// Length of the valid UTF-8 sequence at `text[i]`, or 0: overlong forms, surrogates and C1 controls are
// refused too.
size_t utf8_length(std::string_view text, size_t i) {
  const auto byte = [&](size_t k) { return k < text.size() ? static_cast<unsigned char>(text[k]) : 0u; };
  const auto follows = [&](size_t k) { return (byte(k) & 0xC0u) == 0x80u; };
  const unsigned b = byte(i);
  if (b < 0x80) return b >= 0x20 && b != 0x7F ? 1 : 0;
  if (b >= 0xC2 && b <= 0xDF && follows(i + 1)) return b == 0xC2 && byte(i + 1) < 0xA0 ? 0 : 2;
  if (b >= 0xE0 && b <= 0xEF && follows(i + 1) && follows(i + 2)) {
    if ((b == 0xE0 && byte(i + 1) < 0xA0) || (b == 0xED && byte(i + 1) > 0x9F)) return 0;
    return 3;
  }
  if (b >= 0xF0 && b <= 0xF4 && follows(i + 1) && follows(i + 2) && follows(i + 3)) {
    if ((b == 0xF0 && byte(i + 1) < 0x90) || (b == 0xF4 && byte(i + 1) > 0x8F)) return 0;
    return 4;
  }
  return 0;
}

std::string assemble(std::string_view context, std::string_view message) {
  if (context.empty()) return printable(message, 2000);
  return printable(context, 500) + ": " + printable(message, 2000);
}

}  // namespace

std::string printable(std::string_view text, size_t max_length) {
  std::string out;
  for (size_t i = 0; i < text.size();) {
    if (out.size() >= max_length) return out + "...";
    if (const size_t n = utf8_length(text, i)) {
      out.append(text.substr(i, n));
      i += n;
    } else {
      constexpr char kDigits[] = "0123456789ABCDEF";
      const unsigned char byte = static_cast<unsigned char>(text[i++]);
      out += {'\\', 'x', kDigits[byte / 16], kDigits[byte % 16]};
    }
  }
  return out;
}

Error::Error(ErrorCode code, std::string_view context, std::string_view message)
    : std::runtime_error(assemble(context, message)), code_(code), context_(context), message_(message) {}

}  // namespace patina
