// References of an asset to other bytes: relative URIs that must stay inside the asset's folder, and data
// URIs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace patina::asset {

bool is_data_uri(std::string_view uri);

/// Bytes of a data URI [RFC2397], base64 or percent-encoded. Throws Error{kFormat} with `where` as context.
std::vector<uint8_t> decode_data_uri(std::string_view uri, const std::string& where);

/// A URI's %xx replaced. Throws Error{kFormat} on a malformed one.
std::string percent_decoded(std::string_view uri, const std::string& where);
/// Every byte but letters, digits and -._~/ written as %XX.
std::string percent_encoded(std::string_view path);

/// The file that relative path `reference` (decoded) names. Refused, before anything is opened: empty names,
/// schemes and drive letters, absolute paths, backslashes, control characters, '..' that leaves `folder`, and
/// links that lead out of it. The file need not exist.
std::filesystem::path resolve_inside(const std::filesystem::path& folder, std::string_view reference,
                                     const std::string& where);

}  // namespace patina::asset
