#include "patina/pipeline/option_kinds.h"

#include "patina/asset/uri.h"
#include "patina/base/utf8.h"

namespace patina::pipeline::option_kinds {
namespace {

Kind<float> number_in_units(float low, float high, float (*inside)(float), float (*outside)(float)) {
  return {.kind = ValueKind::kNumber,
          .expected = fmt::format("a number from {} to {}", low, high),
          .decode = [=](const json& value) -> std::optional<float> {
            if (!value.is_number()) return std::nullopt;
            const auto found = value.get<float>();
            return found >= low && found <= high ? std::optional(inside(found)) : std::nullopt;
          },
          .encode = [=](const float& value) { return shortest(outside(value)); }};
}

}  // namespace

void refuse(const Option& option, const json& found) {
  const std::string text = found.is_string()         ? found.get<std::string>()
                           : found.is_number_float() ? fmt::format("{}", found.get<float>())
                                                     : found.dump();
  throw Error(ErrorCode::kUsage, option.name,
              fmt::format("expected {}, found '{}'", option.expected, printable(text)));
}

constexpr std::string_view kEncoded = "file:";

std::string text_of_path(const std::filesystem::path& path) {
  std::string text = path.string();
  if (valid_utf8(text) && !text.starts_with(kEncoded)) return text;
  return std::string(kEncoded) + asset::percent_encoded(text);
}

std::filesystem::path path_of_text(const std::string& text) {
  if (!text.starts_with(kEncoded)) return text;
  return asset::percent_decoded(std::string_view(text).substr(kEncoded.size()), text);
}

json shortest(float value) {
  return json::parse(fmt::format("{}", value));
}

Kind<std::string> text() {
  return {.kind = ValueKind::kText,
          .expected = "a text",
          .decode = [](const json& value) -> std::optional<std::string> {
            return value.is_string() ? std::optional(as_utf8(value.get<std::string>())) : std::nullopt;
          },
          .encode = [](const std::string& value) { return json(value); }};
}

Kind<std::filesystem::path> path() {
  return {.kind = ValueKind::kText,
          .expected = "a path",
          .decode = [](const json& value) -> std::optional<std::filesystem::path> {
            return value.is_string() ? std::optional(path_of_text(value.get<std::string>())) : std::nullopt;
          },
          .encode = [](const std::filesystem::path& value) { return json(text_of_path(value)); }};
}

Kind<bool> truth() {
  return {.kind = ValueKind::kTruth,
          .expected = "true or false",
          .decode = [](const json& value) -> std::optional<bool> {
            return value.is_boolean() ? std::optional(value.get<bool>()) : std::nullopt;
          },
          .encode = [](const bool& value) { return json(value); },
          .word = {},
          .placeholder = "true|false"};
}

Kind<float> number(float low, float high) {
  const auto same = [](float value) { return value; };
  return number_in_units(low, high, same, same);
}

Kind<float> degrees(float low, float high) {
  return number_in_units(
      low, high, [](float value) { return glm::radians(value); },
      [](float value) { return std::round(glm::degrees(value) * 1e4f) / 1e4f; });
}

Option joined(std::vector<Option> options) {
  Option all = options.front();
  for (const Option& option : options) all.parts |= option.parts;
  all.set = [options](Config& c, const json& value) {
    for (const Option& option : options) option.set(c, value);
  };
  return all;
}

}  // namespace patina::pipeline::option_kinds
