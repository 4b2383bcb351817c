// patina-mini, the model that comes with patina, and what a model says about the pictures it was trained on.
#pragma once

#include <filesystem>

#include "patina/pipeline/config.h"

namespace patina::pipeline {

/// The folder of patina-mini: of the installed program, or of the source tree that it was built from. Empty
/// if neither is there.
std::filesystem::path bundled_model();

/// Fills in what depends on the model: patina-mini where none is given, and the resolution that the model was
/// trained at where none is given.
void settle(Config& config);

}  // namespace patina::pipeline
