// What the tables of options are made of: kinds of values, and the function that makes an option of a kind
// and a field.
#pragma once

#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/math.h"
#include "patina/pipeline/options.h"

namespace patina::pipeline::option_kinds {

using nlohmann::json;

/// Throws Error{kUsage}: what the option takes, and what it was given.
[[noreturn]] void refuse(const Option& option, const json& found);

/// A path as text of JSON, and back: as it is, or as "file:" and a percent-encoded path where its bytes are
/// no UTF-8.
std::string text_of_path(const std::filesystem::path& path);
std::filesystem::path path_of_text(const std::string& text);

/// How values of type T stand in files, and which are allowed.
template <class T>
struct Kind {
  ValueKind kind = ValueKind::kText;
  std::string expected;                                 // "a number from 0 to 1"
  std::function<std::optional<T>(const json&)> decode;  // nullopt: not allowed
  std::function<json(const T&)> encode;
  std::string word = {};         // stands for a value: "auto"
  std::string placeholder = {};  // for --help, where the kind tells: "true|false"
};

/// JSON shows 0.35 rather than the float's nearest double 0.3499999940395355.
json shortest(float value);

Kind<std::string> text();
Kind<std::filesystem::path> path();
Kind<bool> truth();
Kind<float> number(float low, float high);
/// Degrees outside, radians inside.
Kind<float> degrees(float low, float high);

template <class Integer>
Kind<Integer> integer(Integer low, Integer high) {
  return {.kind = ValueKind::kInteger,
          .expected = fmt::format("a whole number from {} to {}", low, high),
          .decode = [low, high](const json& value) -> std::optional<Integer> {
            if (!value.is_number_integer()) return std::nullopt;
            if (value.is_number_unsigned()) {  // the seed may be larger than a signed integer
              const auto found = value.get<uint64_t>();
              if (found > static_cast<uint64_t>(high) || std::cmp_less(static_cast<Integer>(found), low))
                return std::nullopt;
              return static_cast<Integer>(found);
            }
            const auto found = value.get<int64_t>();
            if (std::cmp_less(found, low) || std::cmp_greater(found, high)) return std::nullopt;
            return static_cast<Integer>(found);
          },
          .encode = [](const Integer& value) { return json(value); }};
}

template <class Enum>
Kind<Enum> choice(std::vector<std::pair<std::string, Enum>> names) {
  std::string list;
  for (const auto& [name, value] : names) list += (list.empty() ? "" : "|") + name;
  return {.kind = ValueKind::kText,
          .expected = "one of " + list,
          .decode = [names](const json& found) -> std::optional<Enum> {
            for (const auto& [name, value] : names)
              if (found.is_string() && found == name) return value;
            return std::nullopt;
          },
          .encode =
              [names](const Enum& found) {
                for (const auto& [name, value] : names)
                  if (value == found) return json(name);
                return json();
              },
          .word = {},
          .placeholder = list};
}

/// `word` stands for `value`, which need not be among those that the kind allows.
template <class T>
Kind<T> or_word(const std::string& word, const T& value, Kind<T> kind) {
  kind.word = word;
  kind.expected = word + " or " + kind.expected;
  kind.decode = [word, value, decode = kind.decode](const json& found) -> std::optional<T> {
    return found == word ? std::optional(value) : decode(found);
  };
  kind.encode = [word, value, encode = kind.encode](const T& given) {
    return given == value ? json(word) : encode(given);
  };
  return kind;
}

/// `word` stands for nothing given.
template <class T>
Kind<std::optional<T>> optional_or_word(const std::string& word, const Kind<T>& kind) {
  return {.kind = kind.kind,
          .expected = word + " or " + kind.expected,
          .decode = [word, kind](const json& found) -> std::optional<std::optional<T>> {
            if (found == word) return std::optional<T>();
            const std::optional<T> value = kind.decode(found);
            return value ? std::optional<std::optional<T>>(value) : std::nullopt;
          },
          .encode = [word, kind](
                        const std::optional<T>& value) { return value ? kind.encode(*value) : json(word); },
          .word = word};
}

/// What a table says of an option.
struct About {
  std::string name;
  std::vector<std::string> aliases = {};
  std::string placeholder = {};  // empty: the kind's own
  std::string help;
  std::string default_text = {};  // empty: the default's value
};

/// A part of Config: the inputs or a stage's settings, and the heading that its options stand under. A
/// field's function sees this struct alone, so that an option cannot write elsewhere.
template <class Settings>
struct Place {
  std::string group;
  Settings Config::*settings;
  unsigned part;
};

template <class T>
Option described(const About& about, const std::string& group, unsigned part, const Kind<T>& kind) {
  return {.name = about.name,
          .aliases = about.aliases,
          .group = group,
          .placeholder = about.placeholder.empty() ? kind.placeholder : about.placeholder,
          .help = about.help,
          .default_text = about.default_text,
          .parts = part,
          .kind = kind.kind,
          .word = kind.word,
          .expected = kind.expected,
          .is_list = false,
          .splits_at_commas = false,
          .set = {},
          .get = {}};
}

/// `field`: a generic function from Settings& (const or not) to a reference to the T that the option fills.
template <class Settings, class T, class Field>
Option option(const Place<Settings>& place, const About& about, const Kind<T>& kind, Field field) {
  Option made = described(about, place.group, place.part, kind);
  made.set = [named = made, settings = place.settings, kind, field](Config& c, const json& value) {
    const std::optional<T> decoded = kind.decode(value);
    if (!decoded) refuse(named, value);
    field(c.*settings) = *decoded;
  };
  made.get = [settings = place.settings, kind, field](const Config& c) {
    return kind.encode(field(c.*settings));
  };
  const json usual = made.get(Config{});
  if (made.default_text.empty())
    made.default_text = usual.is_string() ? usual.get<std::string>() : usual.dump();
  return made;
}

/// The same for a field that is a std::vector<T>.
template <class Settings, class T, class Field>
Option list_option(const Place<Settings>& place, const About& about, const Kind<T>& kind, Field field) {
  Option made = described(about, place.group, place.part, kind);
  made.is_list = true;
  made.set = [named = made, settings = place.settings, kind, field](Config& c, const json& values) {
    std::vector<T> list;
    for (const json& value : values.is_array() ? values : json::array({values})) {
      const std::optional<T> decoded = kind.decode(value);
      if (!decoded) refuse(named, value);
      list.push_back(*decoded);
    }
    field(c.*settings) = std::move(list);
  };
  made.get = [settings = place.settings, kind, field](const Config& c) {
    json list = json::array();
    for (const T& value : field(c.*settings)) list.push_back(kind.encode(value));
    return list;
  };
  return made;
}

/// One option that several parts read: fills all of their fields.
Option joined(std::vector<Option> options);

}  // namespace patina::pipeline::option_kinds
