// Photographed materials into shard entries: which are taken, in which maps, and who is to be credited.
#pragma once

#include <filesystem>
#include <vector>

#include "mini_data/shard.h"
#include "patina/base/progress.h"

namespace patina::make_dataset {

/// `folder` holds index.json as its README describes. Left out: classes that no recipe uses, materials whose
/// licence is only inferred from file names, scans that are not square, and what lies beyond `limit` a class.
/// About one in six of every class with four or more is held out. Throws Error{kNotFound, kFormat}.
std::vector<mini_data::Entry> material_entries(const std::filesystem::path& folder, int limit,
                                               const Progress& progress);

}  // namespace patina::make_dataset
