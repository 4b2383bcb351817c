// Files that write_file() (files.h) began and that a killed process left.
#pragma once

#include <filesystem>

namespace patina {

/// Removes the hidden files that write_file() writes first and renames then, in a folder and in those below
/// it. For a folder that no other process writes to. What cannot be removed stays.
void remove_half_written(const std::filesystem::path& folder);

}  // namespace patina
