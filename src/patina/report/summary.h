// What a person wants to know first, in words: what changed, where nothing was seen, what to try.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace patina::report {

/// Three short lists as HTML, from metrics ("materials", "unseen", "coverage", "consistency", "fit",
/// "relight") and the run's options; each is left out where nothing is known of it.
std::string summary(const nlohmann::json& metrics, const nlohmann::json& config);

}  // namespace patina::report
