#include "patina/asset/uri.h"

#include <algorithm>
#include <array>
#include <cctype>

#include <fmt/format.h>

#include "patina/base/error.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::array<int8_t, 256> base64_table() {
  std::array<int8_t, 256> table;
  table.fill(-1);
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (size_t i = 0; i < kDigits.size(); ++i)
    table[static_cast<unsigned char>(kDigits[i])] = static_cast<int8_t>(i);
  table['-'] = 62, table['_'] = 63;  // the URL-safe alphabet
  return table;
}

std::vector<uint8_t> base64_decoded(std::string_view text, const std::string& where) {
  static const std::array<int8_t, 256> kTable = base64_table();
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  std::vector<uint8_t> out;
  out.reserve(text.size() / 4 * 3 + 3);
  uint32_t bits = 0;
  int num_bits = 0;
  for (const char c : text) {
    const int digit = kTable[static_cast<unsigned char>(c)];
    if (digit < 0)
      throw Error(ErrorCode::kFormat, where, fmt::format("the base64 data holds the character '{}'", c));
    bits = bits << 6 | static_cast<uint32_t>(digit);
    num_bits += 6;
    if (num_bits >= 8) {
      num_bits -= 8;
      out.push_back(static_cast<uint8_t>(bits >> num_bits));
    }
  }
  if (num_bits == 6) throw Error(ErrorCode::kFormat, where, "the base64 data is cut short");
  return out;
}

// "http:", "file:", "C:": letters, digits, + - . up to a colon that stands before any slash [RFC3986,
// Sec. 3.1].
bool has_scheme(std::string_view uri) {
  const size_t colon = uri.find(':');
  if (colon == std::string_view::npos || colon == 0 || !std::isalpha(static_cast<unsigned char>(uri[0])))
    return false;
  return std::all_of(uri.begin(), uri.begin() + static_cast<std::ptrdiff_t>(colon),
                     [](unsigned char c) { return std::isalnum(c) || c == '+' || c == '-' || c == '.'; });
}

bool is_inside(const fs::path& path, const fs::path& folder) {
  const auto [rest, unused] = std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return rest == folder.end() || (rest->empty() && std::next(rest) == folder.end());
}

}  // namespace

bool is_data_uri(std::string_view uri) {
  return uri.size() >= 5 && std::equal(uri.begin(), uri.begin() + 5, "data:", [](char a, char b) {
           return std::tolower(static_cast<unsigned char>(a)) == b;
         });
}

std::vector<uint8_t> decode_data_uri(std::string_view uri, const std::string& where) {
  const size_t comma = uri.find(',');
  if (comma == std::string_view::npos)
    throw Error(ErrorCode::kFormat, where, "the data URI has no comma before its data");
  const std::string_view data = uri.substr(comma + 1);
  if (uri.substr(0, comma).ends_with(";base64"))
    return base64_decoded(
        data.find('%') == std::string_view::npos ? std::string(data) : percent_decoded(data, where), where);
  const std::string decoded = percent_decoded(data, where);
  return {decoded.begin(), decoded.end()};
}

std::string percent_decoded(std::string_view uri, const std::string& where) {
  std::string out;
  out.reserve(uri.size());
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      out += uri[i];
      continue;
    }
    const int high = i + 2 < uri.size() ? hex_value(uri[i + 1]) : -1,
              low = high >= 0 ? hex_value(uri[i + 2]) : -1;
    if (low < 0)
      throw Error(ErrorCode::kFormat, where,
                  fmt::format("the URI '{}' has a '%' without two hexadecimal digits", printable(uri)));
    out += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return out;
}

std::string percent_encoded(std::string_view path) {
  std::string out;
  for (const char c : path) {
    if (std::isalnum(static_cast<unsigned char>(c)) ||
        std::string_view("-._~/").find(c) != std::string_view::npos)
      out += c;
    else
      out += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return out;
}

fs::path resolve_inside(const fs::path& folder, std::string_view reference, const std::string& where) {
  const auto refuse = [&](std::string_view why) {
    throw Error(ErrorCode::kFormat, where,
                fmt::format("the file reference '{}' {}; only files inside the asset's folder are opened",
                            printable(reference, 100), why));
  };
  if (reference.empty()) refuse("is empty");
  if (has_scheme(reference)) refuse("is not a relative path");
  if (reference.front() == '/') refuse("is an absolute path");
  if (reference.find('\\') != std::string_view::npos) refuse("holds a backslash");
  if (std::any_of(reference.begin(), reference.end(), [](unsigned char c) { return c < 0x20 || c == 0x7F; }))
    refuse("holds a control character");
  if (reference.size() > 4096) refuse("is too long");
  const fs::path relative = fs::path(reference).lexically_normal();
  if (relative.is_absolute() || relative.begin() == relative.end() || *relative.begin() == "..")
    refuse("leaves the asset's folder");
  std::error_code failure;
  const fs::path root = fs::canonical(folder.empty() ? fs::path(".") : folder, failure);
  if (failure)
    throw Error(ErrorCode::kNotFound, where,
                fmt::format("the folder {} cannot be opened: {}", folder.string(), failure.message()));
  const fs::path resolved = fs::weakly_canonical(root / relative, failure);
  if (failure) refuse("cannot be resolved (" + failure.message() + ")");
  if (!is_inside(resolved, root)) refuse("leads out of the asset's folder through a link");
  return folder / relative;
}

}  // namespace patina::asset
