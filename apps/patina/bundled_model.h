// Where patina-mini lies, the model that comes with patina.
#pragma once

#include <filesystem>

namespace patina::app {

/// The folder of patina-mini: of the installed program, or of the source tree that it was built from. Empty
/// if neither is there.
std::filesystem::path bundled_model();

}  // namespace patina::app
