#include "toml_options.h"

#include <charconv>

#include <fmt/format.h>

#include "patina/base/files.h"

namespace patina::app {
namespace {

constexpr uint64_t kMaxBytes = 1 << 20;

// The shortest text that reads as the same number; "inf" and "nan" as they are, which no option takes.
std::string text_of_number(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

void add_text(std::vector<std::string>& texts, const toml::node& node) {
  if (const auto text = node.value_exact<std::string>())
    texts.push_back(*text);
  else if (const auto integer = node.value_exact<int64_t>())
    texts.push_back(std::to_string(*integer));
  else if (const auto number = node.value_exact<double>())
    texts.push_back(text_of_number(*number));
  else if (const auto truth = node.value_exact<bool>())
    texts.emplace_back(*truth ? "true" : "false");
}

}  // namespace

toml::table read_toml(const std::filesystem::path& file) {
  const std::string text = read_text_file(file, kMaxBytes);
  try {
    return toml::parse(text, file.string());
  } catch (const toml::parse_error& e) {
    throw Error(ErrorCode::kUsage, fmt::format("{}:{}", file.string(), e.source().begin.line),
                fmt::format("is not valid TOML: {}", e.description()));
  }
}

std::string place_of(const std::string& file, const toml::node& node) {
  return fmt::format("{}:{}", file, node.source().begin.line);
}

std::vector<std::string> texts_of(const toml::node& node) {
  std::vector<std::string> texts;
  if (const toml::array* list = node.as_array()) {
    for (const toml::node& one : *list) add_text(texts, one);
    if (texts.size() != list->size()) texts.clear();
  } else {
    add_text(texts, node);
  }
  return texts;
}

std::vector<TomlOption> options_of(const toml::table& table, const std::string& file, ErrorCode code) {
  std::vector<TomlOption> found;
  for (const auto& [key, value] : table) {
    const std::string name(key.str());
    const pipeline::Option* option = pipeline::find_option(name);
    if (!option || value.is_table())
      throw Error(code, place_of(file, value),
                  fmt::format("unknown option '{}'; `patina enhance --help` lists them, without the dashes "
                              "here",
                              printable(name)));
    std::vector<std::string> texts = texts_of(value);
    if (texts.empty() || (texts.size() > 1 && !option->is_list))
      throw Error(code, place_of(file, value),
                  fmt::format("'{}': expected {}", name, option->is_list ? "values in [ ]" : "one value"));
    found.push_back({option, std::move(texts), place_of(file, value)});
  }
  return found;
}

}  // namespace patina::app
