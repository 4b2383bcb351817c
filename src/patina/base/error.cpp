#include "patina/base/error.h"

#include "patina/base/utf8.h"

namespace patina {
namespace {

// Length of the UTF-8 sequence at `text[i]` that a terminal may be given: controls (C0, C1, DEL) give 0 too.
size_t printable_length(std::string_view text, size_t i) {
  const auto byte = static_cast<unsigned char>(text[i]);
  if (byte < 0x20 || byte == 0x7F) return 0;
  const size_t length = utf8_length(text, i);
  const bool is_c1 = byte == 0xC2 && length == 2 && static_cast<unsigned char>(text[i + 1]) < 0xA0;
  return is_c1 ? 0 : length;
}

std::string assemble(std::string_view context, std::string_view message) {
  if (context.empty()) return printable(message, 2000);
  return printable(context, 500) + ": " + printable(message, 2000);
}

}  // namespace

const char* name_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return "usage";
    case ErrorCode::kNotFound:
      return "not found";
    case ErrorCode::kFormat:
      return "format";
    case ErrorCode::kUnsupported:
      return "unsupported";
    case ErrorCode::kLimit:
      return "limit";
    case ErrorCode::kIo:
      return "io";
    case ErrorCode::kDevice:
      return "device";
    case ErrorCode::kInterrupted:
      return "interrupted";
    case ErrorCode::kJobs:
      return "jobs";
  }
  return "";
}

std::string printable(std::string_view text, size_t max_length) {
  std::string out;
  for (size_t i = 0; i < text.size();) {
    if (out.size() >= max_length) return out + "...";
    if (const size_t n = printable_length(text, i)) {
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
