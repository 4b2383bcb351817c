// The kinds of options that the list (options.cpp) is made of: how each is parsed, checked, stored and
// written. `member` gives the field of a Config.
#pragma once

#include <charconv>
#include <cmath>
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
using Values = std::span<const std::string>;

[[noreturn]] inline void refuse(const Option& option, std::string_view expected, std::string_view found) {
  throw Error(ErrorCode::kUsage, "--" + option.name,
              fmt::format("expected {}, found '{}'", expected, printable(found)));
}

template <class Number>
Number parse_number(const Option& option, const std::string& text, Number low, Number high) {
  Number value{};
  const char* const end = text.data() + text.size();
  const auto [rest, failure] = std::from_chars(text.data(), end, value);
  const bool in_range = failure == std::errc() && rest == end && value >= low && value <= high;
  if (!in_range)
    refuse(option,
           fmt::format("{}a {} from {} to {}",
                       option.placeholder.find("auto") != std::string::npos ? "auto or " : "",
                       std::is_integral_v<Number> ? "whole number" : "number", low, high),
           text);
  return value;
}

// JSON shows 0.35 rather than the float's nearest double 0.3499999940395355.
inline json shortest(float value) {
  return json::parse(fmt::format("{}", value));
}

// Each fills set, get and default_text.
template <class Member>
Option text_option(Option option, Member member) {
  option.set = [member](Config& c, Values v) { member(c) = v.front(); };
  option.get = [member](const Config& c) { return json(std::string(member(const_cast<Config&>(c)))); };
  return option;
}

template <class Number, class Member>
Option number_option(Option option, Number low, Number high, Member member) {
  const Option named = option;
  option.set = [=](Config& c, Values v) { member(c) = parse_number<Number>(named, v.front(), low, high); };
  option.get = [=](const Config& c) -> json {
    if constexpr (std::is_floating_point_v<Number>)
      return shortest(member(const_cast<Config&>(c)));
    else
      return member(const_cast<Config&>(c));
  };
  if (option.default_text.empty()) option.default_text = option.get(Config{}).dump();
  return option;
}

template <class Enum>
using Names = std::vector<std::pair<std::string, Enum>>;

template <class Enum, class Member>
Option choice_option(Option option, Names<Enum> names, Member member) {
  for (const auto& [name, value] : names)
    option.placeholder += (option.placeholder.empty() ? "" : "|") + name;
  const Option named = option;
  option.set = [=](Config& c, Values v) {
    for (const auto& [name, value] : names)
      if (name == v.front()) {
        member(c) = value;
        return;
      }
    refuse(named, "one of " + named.placeholder, v.front());
  };
  option.get = [=](const Config& c) {
    for (const auto& [name, value] : names)
      if (value == member(const_cast<Config&>(c))) return json(name);
    return json();
  };
  option.default_text = option.get(Config{}).template get<std::string>();
  return option;
}

template <class Member>
Option flag_option(Option option, Member member) {
  option.is_flag = true;
  option.placeholder = "true|false";
  const Option named = option;
  option.set = [=](Config& c, Values v) {
    if (v.front() != "true" && v.front() != "false") refuse(named, "true or false", v.front());
    member(c) = v.front() == "true";
  };
  option.get = [member](const Config& c) { return json(member(const_cast<Config&>(c))); };
  option.default_text = option.get(Config{}).dump();
  return option;
}

inline Option degrees_option(Option option, float low, float high, float& (*member)(Config&)) {
  const Option named = option;
  option.set = [=](Config& c, Values v) {
    member(c) = glm::radians(parse_number(named, v.front(), low, high));
  };
  option.get = [=](const Config& c) {
    return shortest(std::round(glm::degrees(member(const_cast<Config&>(c))) * 1e4f) / 1e4f);
  };
  option.default_text = option.get(Config{}).dump();
  return option;
}

template <class Member>
Option paths_option(Option option, Member member) {
  option.is_list = true;
  option.set = [member](Config& c, Values v) { member(c).assign(v.begin(), v.end()); };
  option.get = [member](const Config& c) {
    json list = json::array();
    for (const std::filesystem::path& path : member(const_cast<Config&>(c))) list.push_back(path.string());
    return list;
  };
  return option;
}

}  // namespace patina::pipeline::option_kinds
