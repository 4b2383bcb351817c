// Checks of options that take numbers. Unlike CLI11's own, they say in words what was expected.
#pragma once

#include <cstdint>
#include <limits>

#include <CLI/CLI.hpp>

namespace patina::tools {

CLI::Validator number();
CLI::Validator positive_number();
/// From `low` to `high`, both included.
CLI::Validator whole_number(int64_t low, int64_t high = std::numeric_limits<int64_t>::max());

}  // namespace patina::tools
