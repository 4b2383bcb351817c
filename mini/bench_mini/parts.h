// Parts of the benchmark that are kept: each writes its result beside a key of all that it read, so that a
// killed run goes on and a part whose inputs have not changed is not measured again.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

namespace patina::bench {

/// The result in FOLDER/NAME.json if it was written under `key`.
std::optional<nlohmann::json> kept_result(const std::filesystem::path& folder, const std::string& name,
                                          const std::string& key);

/// The same, or what `work` returns, written there.
nlohmann::json kept_part(const std::filesystem::path& folder, const std::string& name, const std::string& key,
                         const std::function<nlohmann::json()>& work);

/// Hash of the names and contents of all files in a folder, or of one file; what is written about them (*.md)
/// does not count. Throws Error{kNotFound}.
std::string hash_of_all(const std::filesystem::path& path);

}  // namespace patina::bench
