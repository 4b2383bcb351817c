// Several finished runs on one page.
#pragma once

#include <filesystem>
#include <span>

namespace patina::pipeline {

/// Writes the page that lays the runs side by side (report/comparison_page.h). It shows what their last
/// reports measured and rendered; nothing is run. Throws Error{kNotFound} for a folder that is no run or has
/// no report.
void compare_runs(std::span<const std::filesystem::path> runs, const std::filesystem::path& page);

}  // namespace patina::pipeline
