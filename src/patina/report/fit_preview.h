// The live preview of a running fit: a page that reloads itself every few seconds in a browser.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "patina/image/image.h"

namespace patina::report {

struct FitPreviewPage {
  std::string title, prompt, negative_prompt;
  std::span<const Image> edited, rendered;  // one a view, sRGB [H,W,3]
  std::span<const float> loss;              // per iteration so far
  int iterations = 0;                       // that the fit will have
};

/// One self-contained HTML file, replaced as a whole, so that a browser never reads half of it.
void write_fit_preview(const std::filesystem::path& path, const FitPreviewPage& page);

}  // namespace patina::report
