// Changes to JSON text that leave every byte they do not concern as it was: number formats, order, blanks,
// unknown members.
#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace patina::asset {

/// Describes changes: an object whose members are applied to the members of the same name, recursively.
///   - a member that the text has not is added, any value but an object replaces the old one, null takes the
///   member away;
///   - for an array, members are called by index ("3"), and "+" is an array of elements to append (it makes
///   the array where there is none);
///   - {"=": value} replaces an object or array as a whole.
using JsonPatch = nlohmann::ordered_json;

/// `text` (valid JSON) with `patch` applied. An empty patch gives the text unchanged.
std::string patched_json(std::string_view text, const JsonPatch& patch);

}  // namespace patina::asset
