#include "console/numbers.h"

#include <cmath>
#include <functional>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "patina/base/text.h"

namespace patina::tools {
namespace {

template <class Number>
CLI::Validator check(const std::string& expected, std::function<bool(Number)> is_allowed) {
  return CLI::Validator(
      [=](const std::string& text) {
        const std::optional<Number> value = parse_number<Number>(text);
        if (value && is_allowed(*value)) return std::string();
        return fmt::format("expected {}, found '{}'", expected, text);
      },
      "");  // --help says enough by the type
}

}  // namespace

CLI::Validator number() {
  return check<double>("a number", [](double value) { return std::isfinite(value); });
}

CLI::Validator positive_number() {
  return check<double>("a number above 0", [](double value) { return value > 0 && std::isfinite(value); });
}

CLI::Validator whole_number(int64_t low, int64_t high) {
  const std::string range = high == std::numeric_limits<int64_t>::max()
                                ? fmt::format("of {} or more", low)
                                : fmt::format("from {} to {}", low, high);
  return check<int64_t>("a whole number " + range,
                        [=](int64_t value) { return value >= low && value <= high; });
}

}  // namespace patina::tools
