// A sheet of held-out objects under fixed prompts, to look at while a model is trained.
#pragma once

#include <filesystem>

namespace patina::train_mini {

/// One row an object of WORK/held_out: its clean render, then one picture a prompt, made by the product's own
/// sampler. The same objects, prompts and noise every time.
void write_sheet(const std::filesystem::path& work, const std::filesystem::path& model,
                 const std::filesystem::path& sheet, int rows);

}  // namespace patina::train_mini
