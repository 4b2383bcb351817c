// Typed, checked access to a JSON value that knows where it stands, so that every error names the file
// and the JSON path.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"

namespace patina::asset {

/// Parses JSON text of an untrusted file: nesting and number of values are bounded before the parser
/// allocates. Throws Error{kFormat, kLimit} with `file` as context.
nlohmann::json parse_json(std::string_view text, const std::string& file);

/// What the library says is wrong, without the code in brackets that it begins with.
std::string json_fault(const nlohmann::json::exception& e);

/// A value inside a document. Views are cheap to copy; the document and the file's name must outlive them.
class JsonView {
 public:
  JsonView(const nlohmann::json& value, const std::string& file) : value_(&value), file_(&file) {}

  [[noreturn]] void fail(const std::string& message, ErrorCode code = ErrorCode::kFormat) const;

  /// Member of an object; `find` gives nothing where there is none. Both throw if this is not an object.
  JsonView at(std::string_view key) const;
  std::optional<JsonView> find(std::string_view key) const;

  /// Elements of an array; throws if this is not an array.
  size_t size() const;
  JsonView operator[](size_t index) const;

  /// Values; whole numbers may be written as 4.0. Ranges are inclusive.
  int64_t integer(int64_t min, int64_t max) const;
  size_t index(size_t count, std::string_view of_what) const;  ///< an index into `count` things
  double number() const;                                       ///< finite as a float
  bool boolean() const;
  const std::string& string() const;
  template <class Vector>
  Vector vector() const;  ///< exactly as many numbers as the GLM type has

  const nlohmann::json& json() const { return *value_; }
  std::string where() const { return path_.empty() ? *file_ : *file_ + ": " + path_; }

 private:
  JsonView(const nlohmann::json& value, const std::string* file, std::string path)
      : value_(&value), file_(file), path_(std::move(path)) {}
  std::string kind() const;

  const nlohmann::json* value_;
  const std::string* file_;
  std::string path_;
};

template <class Vector>
Vector JsonView::vector() const {
  constexpr auto kLength = static_cast<size_t>(Vector::length());
  if (!value_->is_array() || value_->size() != kLength)
    fail("expected " + std::to_string(kLength) + " numbers, found " + kind());
  Vector out{};
  for (size_t i = 0; i < kLength; ++i)
    out[static_cast<typename Vector::length_type>(i)] =
        static_cast<typename Vector::value_type>((*this)[i].number());
  return out;
}

}  // namespace patina::asset
