#include "patina/asset/json_view.h"

#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace patina::asset {
namespace {

constexpr int kMaxDepth = 512;             // real files stay below 30
constexpr uint64_t kMaxValues = 16000000;  // about 50 bytes each once parsed

// Counts nesting and values without parsing: brackets, colons and commas outside of strings.
void check_extent(std::string_view text, const std::string& file) {
  int depth = 0;
  uint64_t values = 1;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
      continue;
    }
    if (c == '"') in_string = true;
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    if (c == '[' || c == '{' || c == ',') ++values;
    if (depth > kMaxDepth)
      throw Error(ErrorCode::kLimit, file,
                  fmt::format("the JSON is nested more than {} levels deep", kMaxDepth));
  }
  if (values > kMaxValues)
    throw Error(ErrorCode::kLimit, file, fmt::format("the JSON holds more than {} values", kMaxValues));
}

}  // namespace

nlohmann::json parse_json(std::string_view text, const std::string& file) {
  check_extent(text, file);
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& e) {
    throw Error(ErrorCode::kFormat, file, fmt::format("the JSON is malformed: {}", json_fault(e)));
  }
}

std::string json_fault(const nlohmann::json::exception& e) {
  const std::string what = e.what();
  const size_t begin = what.find("] ");
  return what.substr(begin == std::string::npos ? 0 : begin + 2);
}

std::string JsonView::kind() const {
  if (value_->is_array()) return fmt::format("an array of {}", value_->size());
  if (value_->is_number() || value_->is_boolean()) return value_->dump();
  if (value_->is_string()) return "the string '" + printable(value_->get_ref<const std::string&>(), 60) + "'";
  return std::string("a value of type ") + value_->type_name();
}

void JsonView::fail(const std::string& message, ErrorCode code) const {
  throw Error(code, where(), message);
}

std::optional<JsonView> JsonView::find(std::string_view key) const {
  if (!value_->is_object()) fail("expected an object, found " + kind());
  const auto found = value_->find(key);
  if (found == value_->end()) return std::nullopt;
  return JsonView(*found, file_, path_ + "/" + std::string(key));
}

JsonView JsonView::at(std::string_view key) const {
  auto found = find(key);
  if (!found) fail(fmt::format("'{}' is missing", key));
  return *std::move(found);
}

size_t JsonView::size() const {
  if (!value_->is_array()) fail("expected an array, found " + kind());
  return value_->size();
}

JsonView JsonView::operator[](size_t i) const {
  if (i >= size()) fail(fmt::format("has no element {}", i));
  return JsonView((*value_)[i], file_, path_ + "/" + std::to_string(i));
}

int64_t JsonView::integer(int64_t min, int64_t max) const {
  std::optional<int64_t> value;
  if (value_->is_number_unsigned()) {
    const auto u = value_->get<uint64_t>();
    value = u > static_cast<uint64_t>(std::numeric_limits<int64_t>::max())
                ? std::numeric_limits<int64_t>::max()
                : static_cast<int64_t>(u);
  } else if (value_->is_number_integer()) {
    value = value_->get<int64_t>();
  } else if (value_->is_number_float()) {
    const double d = value_->get<double>();
    if (d == std::floor(d) && std::abs(d) < 9.0e15) value = static_cast<int64_t>(d);
  }
  if (!value) fail("expected a whole number, found " + kind());
  if (*value < min || *value > max)
    fail(fmt::format("expected a whole number from {} to {}, found {}", min, max, kind()));
  return *value;
}

size_t JsonView::index(size_t count, std::string_view of_what) const {
  const int64_t value = integer(std::numeric_limits<int64_t>::min(), std::numeric_limits<int64_t>::max());
  if (value < 0 || static_cast<uint64_t>(value) >= count)
    fail(fmt::format("refers to {} {}, but the file has {}", of_what, kind(), count));
  return static_cast<size_t>(value);
}

double JsonView::number() const {
  if (!value_->is_number()) fail("expected a number, found " + kind());
  const double value = value_->get<double>();
  if (!std::isfinite(static_cast<float>(value))) fail("the number is too large: " + kind());
  return value;
}

bool JsonView::boolean() const {
  if (!value_->is_boolean()) fail("expected true or false, found " + kind());
  return value_->get<bool>();
}

const std::string& JsonView::string() const {
  if (!value_->is_string()) fail("expected a string, found " + kind());
  return value_->get_ref<const std::string&>();
}

}  // namespace patina::asset
