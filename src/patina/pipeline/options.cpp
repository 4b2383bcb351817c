#include "patina/pipeline/options.h"

#include <cmath>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/text.h"
#include "patina/pipeline/option_groups.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {
namespace {

using nlohmann::json;

std::vector<Option> make_options() {
  std::vector<Option> list{preset_option()};
  for (auto* group : {edit_options, mask_options, input_output_options, model_options, view_options,
                      prior_options, fit_options, machine_options})
    for (Option& option : group()) list.push_back(std::move(option));
  return list;
}

json value_of_text(const Option& option, const std::string& text) {
  if (!option.word.empty() && text == option.word) return text;
  switch (option.kind) {
    case ValueKind::kText:
      return text;
    case ValueKind::kInteger:
      if (const auto value = parse_number<uint64_t>(text)) return *value;
      if (const auto value = parse_number<int64_t>(text)) return *value;
      break;
    case ValueKind::kNumber:
      if (const auto value = parse_number<float>(text); value && std::isfinite(*value)) return *value;
      break;
    case ValueKind::kTruth:
      if (text == "true" || text == "false") return text == "true";
      break;
  }
  option_kinds::refuse(option, text);
}

}  // namespace

const std::vector<Option>& options() {
  static const std::vector<Option> list = make_options();
  return list;
}

const Option* find_option(std::string_view name) {
  for (const Option& option : options())
    if (option.name == name) return &option;
  return nullptr;
}

json value_of_texts(const Option& option, std::span<const std::string> texts) {
  if (!option.is_list) return value_of_text(option, texts.back());
  json list = json::array();
  for (const std::string& text : texts)
    for (size_t begin = 0, end; begin <= text.size(); begin = end + 1) {
      end = option.splits_at_commas ? std::min(text.find(',', begin), text.size()) : text.size();
      list.push_back(value_of_text(option, text.substr(begin, end - begin)));
    }
  return list;
}

json to_json(const Config& config) {
  json values = json::object();
  for (const Option& option : options()) values[option.name] = option.get(config);
  return values;
}

void apply_json(Config& config, const json& values, const std::string& context) {
  if (!values.is_object()) throw Error(ErrorCode::kFormat, context, "expected an object of options");
  for (const auto& [name, value] : values.items()) {
    if (!find_option(name))
      throw Error(ErrorCode::kFormat, context, fmt::format("unknown option '{}'", printable(name)));
  }
  // In the order of the list, not of the file: a preset comes before what it would else overwrite.
  for (const Option& option : options()) {
    if (!values.contains(option.name)) continue;
    try {
      option.set(config, values[option.name]);
    } catch (const Error& e) {
      throw Error(ErrorCode::kFormat, context + ": " + option.name, e.message());
    }
  }
}

}  // namespace patina::pipeline
