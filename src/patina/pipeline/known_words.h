// Words of a prompt that a small model does not know: it takes them for noise, and the run is spent in vain.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "patina/base/progress.h"
#include "patina/pipeline/settings.h"

namespace patina::pipeline {

/// What words.txt in the model's folder lists, one word a line; empty for models without one, which know
/// words of any kind.
std::vector<std::string> known_words(const std::filesystem::path& model);

/// The words of a prompt that are not among `known`, each once, as they are written: letters and bytes beyond
/// ASCII, three or more. Empty where `known` is.
std::vector<std::string> unknown_words(const std::vector<std::string>& known, std::string_view prompt);

/// A warning that names the words of the prompts, those of parts too, that the chosen model does not know.
void warn_of_unknown_words(const EditSettings& settings, const Progress& progress);

}  // namespace patina::pipeline
