// Where patina-mini lies, the model that comes with patina.
#pragma once

#include <filesystem>
#include <vector>

namespace patina::app {

/// The folder of patina-mini: of the installed program, or of the source tree that it was built from. Empty
/// if neither is there.
std::filesystem::path bundled_model();

/// The folders in which bundled_model() looks, in its order.
std::vector<std::filesystem::path> bundled_model_places();

}  // namespace patina::app
