// Several runs side by side on one page: prompts, seeds and other options that differ, pictures, measures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/image/image.h"

namespace patina::report {

struct ComparedRun {
  std::string name;   // of the run folder
  std::string asset;  // file name
  std::string prompt, negative_prompt;
  nlohmann::json options;          // every option by name
  nlohmann::json metrics;          // as metrics.json
  std::vector<Image> after;        // one a view, sRGB
  std::vector<uint8_t> turntable;  // WebP; empty: none
};

struct ComparisonData {
  std::vector<ComparedRun> runs;
  std::vector<Image> before;  // the views that all runs began with; empty where they began with others
};

/// Writes the page, which is one file as a report is.
void write_comparison(const std::filesystem::path& path, const ComparisonData& data);

}  // namespace patina::report
