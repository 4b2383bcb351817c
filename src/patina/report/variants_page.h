// Edits of the same views by several seeds, one below the other, to choose from.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/image/image.h"

namespace patina::report {

struct VariantsPage {
  std::string title;  // asset file name
  std::string prompt, negative_prompt;
  std::vector<Image> before;  // one a view, sRGB
  struct Variant {
    std::string name;           // "seed 3"
    std::vector<Image> edited;  // one a view, sRGB
  };
  std::vector<Variant> variants;
};

/// One HTML file with all pictures inside. Throws Error{kIo}.
void write_variants(const std::filesystem::path& path, const VariantsPage& page);

}  // namespace patina::report
