// What becomes of each glTF extension: the one table that the reader asks and docs/formats.md shows.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

namespace patina::asset {

enum class ExtensionUse {
  kObeyed,       // read, and the views show what it says
  kCarriedOver,  // kept in the output; nothing that a still picture of the surface would show
  kNoted,        // kept in the output, but the views do not show what it says: a note names it
  kRefused,      // a file that requires it is refused by its name; where it is only used, noted
};

struct ExtensionRow {
  const char* name;
  ExtensionUse use;
  const char* remark;  // what that means for a user, a short sentence
};

/// Every extension of the Khronos registry and some that are not in it, by name.
std::span<const ExtensionRow> extension_table();

/// The row of that name; nullptr for an extension that patina does not know. Those are carried over with a
/// note, or refused where the file requires them.
const ExtensionRow* find_extension(std::string_view name);

/// Names under any "extensions" of `json`, and in its extensionsUsed: sorted, each once.
std::vector<std::string> extensions_in(const nlohmann::json& json);

}  // namespace patina::asset
