// What was measured, in words: the metrics with their units and what is good, and the stages with time and
// memory.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace patina::report {

/// A <table> with one row a known metric that `metrics` holds, then one a key that is not known; empty if
/// there is none.
std::string metrics_table(const nlohmann::json& metrics);

/// A <table> of metrics["stages"]; empty if there is none.
std::string stage_table(const nlohmann::json& metrics);

/// Sum of the stages' seconds; 0 if there is none.
double total_seconds(const nlohmann::json& metrics);

}  // namespace patina::report
