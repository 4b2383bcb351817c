// The example asset with textures a thirty-second as wide, for tests that run whole stages: reading, fitting
// and showing its own textures takes most of a small run.
#pragma once

#include <filesystem>

namespace patina::test {

/// examples/kettle.glb with textures of 32, 16 and 8 texels a side. Made once a test program.
std::filesystem::path small_kettle();

}  // namespace patina::test
