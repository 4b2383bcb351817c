// What an option does, as one picture.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/base/progress.h"
#include "patina/image/image.h"
#include "patina/pipeline/config.h"

namespace patina::make_gallery {

/// One option of the command line and the values to show.
struct OptionSheet {
  std::string option;  // without its dashes
  std::vector<std::string> values;
};

/// View `view` of an edit under each value of the option, in a row, and left of them as it was rendered; each
/// `side` pixels wide. A row for each of `edits`, whose run folders lie in `folder`/<asset>; they render once
/// and go on where they were stopped. Throws Error.
Image option_sheet(const OptionSheet& sheet, const std::vector<pipeline::Config>& edits,
                   const std::filesystem::path& folder, int view, int side, const Progress& progress);

}  // namespace patina::make_gallery
