#include "patina/pipeline/known_words.h"

#include <algorithm>
#include <sstream>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/diffusion/text/prompt.h"

namespace patina::pipeline {
namespace {

constexpr size_t kShortest = 3;  // "a", "of", "in" say nothing of a material

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || static_cast<unsigned char>(c) >= 0x80;
}

}  // namespace

std::vector<std::string> known_words(const std::filesystem::path& model) {
  const std::filesystem::path file = model / "words.txt";
  std::vector<std::string> words;
  if (!std::filesystem::is_regular_file(file)) return words;
  std::istringstream text(read_text_file(file, 1 << 20));
  for (std::string word; text >> word;) words.push_back(word);
  return words;
}

std::vector<std::string> unknown_words(const std::vector<std::string>& known, std::string_view prompt) {
  std::vector<std::string> found;
  if (known.empty()) return found;
  for (const diffusion::PromptPart& part : diffusion::parse_prompt(prompt))
    for (size_t begin = 0, end; begin < part.text.size(); begin = end + 1) {
      end = begin;
      while (end < part.text.size() && is_letter(part.text[end])) ++end;
      const std::string word = part.text.substr(begin, end - begin);
      if (word.size() >= kShortest && std::find(known.begin(), known.end(), lowered(word)) == known.end() &&
          std::find(found.begin(), found.end(), word) == found.end())
        found.push_back(word);
    }
  return found;
}

void warn_of_unknown_words(const EditSettings& settings, const Progress& progress) {
  std::string prompts = settings.options.prompt, list;
  for (const std::string& value : settings.prompt_for)  // "MATERIAL=TEXT"
    prompts += ", " + value.substr(value.rfind('=') + 1);
  for (const std::string& word : unknown_words(known_words(settings.model.model), prompts))
    list += fmt::format("{}'{}'", list.empty() ? "" : ", ", printable(word, 40));
  if (!list.empty())
    progress.warn(
        fmt::format("the model does not know {}, which will have no effect or an odd one; `patina "
                    "models` lists the words that it knows",
                    list));
}

}  // namespace patina::pipeline
